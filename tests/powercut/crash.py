"""What a disk may hold after a power cut: a trace of changes, cut at one of them, less what was not flushed.

As POSIX allows it, and worse than most file systems do it:

- the content of a file is what its last fsync saw; of the writes after it, any may be there, in part or not;
- an entry of a folder (made, renamed, removed) is there for certain after an fsync of that folder; of the
  changes after it, the first few are.
"""

import base64
import json
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

SECTOR_BYTES = 512
ROOT = 0


def read_trace(path: Path) -> list[dict[str, Any]]:
    """Return the changes of a trace, oldest first."""
    with open(path) as file:
        return [json.loads(line) for line in file]


def survivors(trace: Sequence[dict[str, Any]], chance: random.Random) -> tuple[dict, dict]:
    """Return entries (folder number -> name -> node) and contents (node -> bytes) after a cut at the end."""
    contents: dict[int, bytes] = {}
    entries: dict[int, dict[str, int]] = {ROOT: {}}
    pending_data: dict[int, list[dict]] = {}
    pending_names: dict[int, list[dict]] = {ROOT: []}
    live: dict[int, dict[str, int]] = {ROOT: {}}
    for change in trace:
        _follow(change, live)
        if change["op"] in ("write", "truncate"):
            pending_data.setdefault(change["node"], []).append(change)
        elif change["op"] == "fsync":
            node = change["node"]
            contents[node] = _apply(contents.get(node, b""), pending_data.pop(node, []))
        elif change["op"] == "fsyncdir":
            _commit(change["node"], pending_names, entries, len(pending_names.get(change["node"], [])))
        else:
            for folder in {change["folder"], change.get("source", change["folder"])}:
                pending_names.setdefault(folder, []).append(change)
    for folder in list(pending_names):
        _commit(folder, pending_names, entries, chance.randint(0, len(pending_names[folder])))
    for node, changes in pending_data.items():
        kept = [_torn(change, chance) for change in changes if chance.random() < 0.5]
        contents[node] = _apply(contents.get(node, b""), kept)
    return entries, contents


def materialise(entries: dict, contents: dict, folder: Path, node: int = ROOT) -> None:
    """Write the survivors to a real folder."""
    folder.mkdir(exist_ok=True)
    for name, child in entries.get(node, {}).items():
        if child in entries:
            materialise(entries, contents, folder / name, child)
        else:
            (folder / name).write_bytes(contents.get(child, b""))


def _follow(change: dict, live: dict[int, dict[str, int]]) -> None:
    """Note in the change which node it moves: the names are those of the running system."""
    if change["op"] == "make":
        live[change["folder"]][change["name"]] = change["node"]
        live.setdefault(change["node"], {})
    elif change["op"] == "rename":
        change["node"] = live[change["source"]].pop(change["old"])
        live[change["folder"]][change["new"]] = change["node"]
    elif change["op"] == "remove":
        change["node"] = live[change["folder"]].pop(change["name"])


def _commit(folder: int, pending: dict, entries: dict, count: int) -> None:
    """Make the first `count` waiting changes of a folder last. A rename is one change of both its folders."""
    for change in pending.get(folder, [])[:count]:
        if change["op"] == "make":
            entries.setdefault(folder, {})[change["name"]] = change["node"]
            if change["kind"] == "folder":
                entries.setdefault(change["node"], {})
        elif change["op"] == "remove":
            entries.setdefault(folder, {}).pop(change["name"], None)
        else:
            entries.setdefault(change["source"], {}).pop(change["old"], None)
            entries.setdefault(change["folder"], {})[change["new"]] = change["node"]
            other = change["source"] if folder == change["folder"] else change["folder"]
            if other != folder and change in pending.get(other, []):
                pending[other].remove(change)
    pending[folder] = pending.get(folder, [])[count:]


def _apply(content: bytes, changes: Sequence[dict]) -> bytes:
    data = bytearray(content)
    for change in changes:
        if change["op"] == "truncate":
            del data[change["length"] :]
            data.extend(bytes(change["length"] - len(data)))
        else:
            new = base64.b64decode(change["data"])
            data.extend(bytes(max(0, change["at"] - len(data))))
            data[change["at"] : change["at"] + len(new)] = new
    return bytes(data)


def _torn(change: dict, chance: random.Random) -> dict:
    """Return the change, or of a write only the first sectors."""
    if change["op"] == "truncate" or chance.random() < 0.5:
        return change
    data = base64.b64decode(change["data"])
    kept = data[: SECTOR_BYTES * chance.randint(0, len(data) // SECTOR_BYTES)]
    return change | {"data": base64.b64encode(kept).decode()}
