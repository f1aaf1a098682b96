"""Durable writes: a killed process or a power cut leaves either the old file or the new one.

Temporary name in the same folder, write, fsync, rename, fsync of the folder.
"""

import contextlib
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any


@contextlib.contextmanager
def durable_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path to write to; on success it becomes `path`, on failure it is removed."""
    make_folder(path.parent)
    # The suffix stays last: writers choose their format by it.
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.tmp{path.suffix}")
    try:
        yield temporary
        sync(temporary)
        temporary.replace(path)
        sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


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
