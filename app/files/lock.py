"""Locks between threads and processes: held on an open file, so a process that dies lets go of them.

`locked` guards what reads a folder's files, changes them and writes them back; `alone` keeps a second program
off a whole folder. Neither works on a network file system without locks.
"""

import contextlib
import fcntl
import json
import os
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from app.errors import AirlensError

LOCK_FILE = ".lock"
WAIT_S = 20.0
LOOK_S = 0.002


@contextlib.contextmanager
def locked(folder: Path, wait_s: float = WAIT_S) -> Iterator[None]:
    """Hold the lock of an existing `folder`, for the milliseconds of a change. It cannot be taken twice.

    Raises FileNotFoundError when the folder is gone, AirlensError when somebody else keeps the lock.
    """
    descriptor = os.open(folder / LOCK_FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        deadline_s = time.monotonic() + wait_s
        while not _taken(descriptor):
            if time.monotonic() > deadline_s:
                raise AirlensError(
                    f"Another program has been changing {folder} for {wait_s:g} s. Wait for its end, then try again."
                )
            time.sleep(LOOK_S)
        yield
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def alone(path: Path, what: str) -> Iterator[None]:
    """Hold `path` as the only `what` until the end. Raises AirlensError that names the one that holds it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        if not _taken(descriptor):
            raise AirlensError(
                f"{_holder(descriptor, what)} uses {path.parents[1]} already. Use that one, stop it first, "
                "or give another folder."
            )
        told = json.dumps({"pid": os.getpid(), "since_s": time.time()})
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, told.encode(), 0)
        yield
    finally:
        os.close(descriptor)


def _taken(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _holder(descriptor: int, what: str) -> str:
    try:
        told = json.loads(os.pread(descriptor, 1000, 0))
        since = datetime.fromtimestamp(float(told["since_s"])).astimezone()
        return f"Another {what} (process {int(told['pid'])}, since {since:%Y-%m-%d %H:%M})"
    except (ValueError, KeyError, TypeError, OverflowError, OSError):
        return f"Another {what}"
