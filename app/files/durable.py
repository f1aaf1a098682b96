"""Durable writes: a killed process or a power cut leaves either the old file or the new one.

Temporary name in the same folder, write, fsync, rename, fsync of the folder. Every write has a temporary name
of its own, so that two writers of one file never write into one another. What a killed writer leaves behind is
known by its name and removed by `sweep`.
"""

import contextlib
import json
import os
import re
import secrets
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil

# `.result.PID-RANDOM.tmp.json`: hidden, and whose it is.
_TEMPORARY = re.compile(r"\..*\.(\d+)-[0-9a-f]{16}\.tmp(\.[^.]*)?")
LEFT_AFTER_S = 3600.0


@contextlib.contextmanager
def durable_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path to write to; on success it becomes `path`, on failure it is removed."""
    make_folder(path.parent)
    temporary = temporary_name(path)
    # Exclusive: a name that is there already is somebody else's.
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    try:
        yield temporary
        sync(temporary)
        temporary.replace(path)
        sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def durable_folder(target: Path) -> Iterator[Path]:
    """Yield a hidden folder to fill; on success it becomes `target` as a whole, on failure it is removed.

    Raises OSError (ENOTEMPTY, EEXIST) when `target` holds something by then.
    """
    with staging_folder(target) as staging:
        yield staging
        publish_folder(staging, target)


@contextlib.contextmanager
def staging_folder(beside: Path) -> Iterator[Path]:
    """Yield a hidden folder to fill and to publish; what is not published is removed."""
    make_folder(beside.parent)
    staging = temporary_name(beside)
    staging.mkdir()
    try:
        yield staging
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def temporary_name(path: Path) -> Path:
    """A hidden name beside `path` that no other writer has, and that `sweep` knows."""
    # The suffix stays last: writers choose their format by it.
    return path.with_name(f".{path.stem[:100]}.{os.getpid()}-{secrets.token_hex(8)}.tmp{path.suffix}")


def sweep(folder: Path) -> list[Path]:
    """Remove, below `folder`, what killed writers left, and return it.

    A leftover was not written for an hour, and the process that its name tells is gone.
    """
    left = []
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(parent) / name
            if _is_left(path):
                shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
                left.append(path)
        folders[:] = [name for name in folders if not _TEMPORARY.fullmatch(name)]
    return left


def _is_left(path: Path) -> bool:
    named = _TEMPORARY.fullmatch(path.name)
    if named is None or psutil.pid_exists(int(named.group(1))):
        return False
    try:
        return time.time() - path.lstat().st_mtime > LEFT_AFTER_S
    except FileNotFoundError:
        return False


def write_durably(path: Path, write: Callable[[Path], object]) -> None:
    """Call `write(temporary)` and put the outcome in place of `path`."""
    with durable_path(path) as temporary:
        write(temporary)


def write_text(path: Path, text: str) -> None:
    """Replace `path` by `text` (UTF-8)."""
    write_durably(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def write_json(path: Path, content: Any) -> None:
    """Replace `path` by `content` as JSON; NaN is refused, since JSON has none."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def make_folder(path: Path) -> None:
    """Create `path` and its parents so that a power cut does not lose them; existing ones are kept."""
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    for folder in reversed(missing):
        folder.mkdir(exist_ok=True)
        sync(folder.parent)


def publish_folder(staging: Path, target: Path) -> None:
    """Put a finished folder in place of `target`, which must not exist or be empty: whole, or not at all.

    Both are on one file system. Raises OSError (ENOTEMPTY, EEXIST) when `target` holds something.
    """
    for folder, _, files in os.walk(staging):
        for name in files:
            sync(Path(folder) / name)
        sync(Path(folder))
    staging.rename(target)
    sync(target.parent)


def sync(path: Path) -> None:
    """Flush a file's or a folder's content to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
