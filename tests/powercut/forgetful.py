"""A file system in memory that writes down every change, so that a power cut can be replayed at any of them.

    python -m tests.powercut.forgetful MOUNTPOINT TRACE

Reading and writing work as on any disk. TRACE holds one JSON line a change or flush. A write to the file
`.full` in the root sets how many more data writes succeed before the disk is full; `-1` frees it.
"""

import base64
import errno
import itertools
import json
import os
import stat
import sys
import time
from pathlib import PurePosixPath
from typing import Any

import mfusepy

CAPACITY_BYTES = 1 << 40
BLOCK_BYTES = 4096


class Node:
    """A file (content) or a folder (entries)."""

    def __init__(self, number: int, mode: int) -> None:
        self.number, self.mode, self.links = number, mode, 1
        self.content = bytearray()
        self.entries: dict[str, Node] = {}
        self.changed_ns = time.time_ns()


class Forgetful(mfusepy.Operations):
    """The operations that a ledger, its jobs and captures need."""

    use_ns = True

    def __init__(self, trace: str) -> None:
        self._trace = open(trace, "w", buffering=1 << 20)
        self._numbers = itertools.count(1)
        self._handles = itertools.count(1)
        self._root = Node(0, stat.S_IFDIR | 0o755)
        self._open: dict[int, Node] = {}
        self._writes_left = -1

    def destroy(self, path: str) -> None:
        self._trace.close()

    # Reading

    def getattr(self, path: str, fh: int | None = None) -> dict[str, Any]:
        node = self._open[fh] if fh in self._open else self._find(path)
        blocks = -(-len(node.content) // 512)
        times = dict.fromkeys(("st_atime", "st_mtime", "st_ctime"), node.changed_ns)
        return times | {
            "st_mode": node.mode,
            "st_ino": node.number + 1,
            "st_nlink": 1,
            "st_size": len(node.content),
            "st_blocks": blocks,
            "st_uid": os.getuid(),
            "st_gid": os.getgid(),
        }

    def readdir(self, path: str, fh: int) -> list[str]:
        return [".", "..", *self._find(path).entries]

    def open(self, path: str, flags: int) -> int:
        return self._handle(self._find(path))

    def release(self, path: str, fh: int) -> int:
        self._open.pop(fh, None)
        return 0

    def read(self, path: str, size: int, offset: int, fh: int) -> bytes:
        return bytes(self._open[fh].content[offset : offset + size])

    def statfs(self, path: str) -> dict[str, int]:
        blocks = CAPACITY_BYTES // BLOCK_BYTES
        free = 0 if self._writes_left == 0 else blocks
        sizes = {"f_bsize": BLOCK_BYTES, "f_frsize": BLOCK_BYTES, "f_namemax": 255}
        return sizes | {"f_blocks": blocks, "f_bfree": free, "f_bavail": free}

    # Changing

    def create(self, path: str, mode: int, fi: object = None) -> int:
        return self._handle(self._make(path, stat.S_IFREG | mode))

    def mkdir(self, path: str, mode: int) -> int:
        self._make(path, stat.S_IFDIR | mode)
        return 0

    def write(self, path: str, data: bytes, offset: int, fh: int) -> int:
        node = self._open[fh]
        if path == "/.full":
            self._writes_left = int(data)
            return len(data)
        self._spend()
        _put(node.content, data, offset)
        node.changed_ns = time.time_ns()
        self._note(op="write", node=node.number, at=offset, data=base64.b64encode(data).decode())
        return len(data)

    def truncate(self, path: str, length: int, fh: int | None = None) -> int:
        node = self._open[fh] if fh in self._open else self._find(path)
        _cut(node.content, length)
        self._note(op="truncate", node=node.number, length=length)
        return 0

    def rename(self, old: str, new: str, flags: int = 0) -> int:
        node, (folder, name) = self._find(old), self._place(new)
        if name in folder.entries and folder.entries[name].entries:
            raise mfusepy.FuseOSError(errno.ENOTEMPTY)
        source, source_name = self._place(old)
        del source.entries[source_name]
        folder.entries[name] = node
        self._note(op="rename", source=source.number, old=source_name, folder=folder.number, new=name)
        return 0

    def unlink(self, path: str) -> int:
        return self._remove(path)

    def rmdir(self, path: str) -> int:
        if self._find(path).entries:
            raise mfusepy.FuseOSError(errno.ENOTEMPTY)
        return self._remove(path)

    def fsync(self, path: str, datasync: int, fh: int) -> int:
        self._note(op="fsync", node=self._open[fh].number)
        return 0

    def fsyncdir(self, path: str, datasync: int, fh: int) -> int:
        self._note(op="fsyncdir", node=self._find(path).number)
        return 0

    def chmod(self, path: str, mode: int) -> int:
        self._find(path).mode = mode
        return 0

    def chown(self, path: str, uid: int, gid: int) -> int:
        return 0

    def utimens(self, path: str, times: tuple[int, int] | None = None) -> int:
        self._find(path).changed_ns = times[1] if times else time.time_ns()
        return 0

    # Helpers

    def _make(self, path: str, mode: int) -> Node:
        if self._writes_left == 0 and path != "/.full":
            raise mfusepy.FuseOSError(errno.ENOSPC)
        folder, name = self._place(path)
        node = folder.entries[name] = Node(next(self._numbers), mode)
        kind = "folder" if stat.S_ISDIR(mode) else "file"
        self._note(op="make", folder=folder.number, name=name, node=node.number, kind=kind)
        return node

    def _remove(self, path: str) -> int:
        folder, name = self._place(path)
        del folder.entries[name]
        self._note(op="remove", folder=folder.number, name=name)
        return 0

    def _spend(self) -> None:
        if self._writes_left == 0:
            raise mfusepy.FuseOSError(errno.ENOSPC)
        self._writes_left -= self._writes_left > 0

    def _handle(self, node: Node) -> int:
        handle = next(self._handles)
        self._open[handle] = node
        return handle

    def _find(self, path: str) -> Node:
        node = self._root
        for part in PurePosixPath(path).parts[1:]:
            if part not in node.entries:
                raise mfusepy.FuseOSError(errno.ENOENT)
            node = node.entries[part]
        return node

    def _place(self, path: str) -> tuple[Node, str]:
        place = PurePosixPath(path)
        return self._find(str(place.parent)), place.name

    def _note(self, **change: Any) -> None:
        self._trace.write(json.dumps(change) + "\n")


def _put(content: bytearray, data: bytes, offset: int) -> None:
    if len(content) < offset:
        content.extend(bytes(offset - len(content)))
    content[offset : offset + len(data)] = data


def _cut(content: bytearray, length: int) -> None:
    del content[length:]
    content.extend(bytes(length - len(content)))


if __name__ == "__main__":
    mfusepy.FUSE(Forgetful(sys.argv[2]), sys.argv[1], foreground=True, nothreads=True, fsname="forgetful")
