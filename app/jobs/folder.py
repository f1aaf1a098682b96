"""A job is a directory and a command. This is the directory, and who may write in it.

job.json                 kind, experiment, settings
owner.json               the attempt that owns the job now, with its token: the fence
lock                     held for the moment of changing the owner or publishing the result
attempts/0001/worker.lock    held (flock) as long as the worker lives
attempts/0001/worker.json    process id and host
attempts/0001/heartbeat      a counter that a living worker raises
attempts/0001/events.jsonl   progress, appended
attempts/0001/checkpoint/    files written durably by the solver
attempts/0001/exit.json      how the worker ended, if it could say so
result/                      put in place by one rename
"""

import contextlib
import fcntl
import json
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from app.files.durable import make_folder, write_json
from app.jobs import kinds
from app.jobs.errors import FencedError, JobError

_LOCK_WAIT_S = 5.0


@dataclass(frozen=True)
class Owner:
    """The attempt that may write, and the secret that proves it."""

    attempt: int
    token: str


@dataclass(frozen=True)
class JobFolder:
    """Paths and the fence of one job."""

    path: Path

    def order(self) -> dict[str, Any]:
        """Return what job.json asks for. Raises JobError when it cannot be read."""
        path = self.path / "job.json"
        try:
            order = json.loads(path.read_text(encoding="utf-8"))
            return {name: order[name] for name in ("kind", "experiment", "title", "settings", "submitted_s")}
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise JobError(
                f"{path} cannot be read as an order ({type(error).__name__}: {error}). Restore it from a copy and "
                "`retry`, or submit the job again."
            ) from error

    def attempt(self, number: int) -> Path:
        """Return the folder of an attempt."""
        return self.path / "attempts" / f"{number:04d}"

    def target(self) -> Path:
        """Return where the finished result goes."""
        order = self.order()
        target = getattr(kinds.load(order["kind"]), "target", None)
        return target(order, self.path) if target else self.path / "result"

    def staging(self, number: int) -> Path:
        """Return the folder beside the target in which an attempt prepares the result."""
        target = self.target()
        return target.with_name(f".{self.path.name}.{target.name}.{number:04d}.tmp")

    def is_published(self) -> bool:
        """True when the whole result is in place."""
        return (self.target() / "result.json").is_file()

    def owner(self) -> Owner:
        """Return the current owner. Raises OSError when the folder cannot be read."""
        content = json.loads((self.path / "owner.json").read_text(encoding="utf-8"))
        return Owner(attempt=content["attempt"], token=content["token"])

    def hand_over(self, owner: Owner) -> None:
        """Make `owner` the only attempt that may publish. Raises TimeoutError when the lock is stuck."""
        make_folder(self.attempt(owner.attempt))
        with self.locked():
            write_json(self.path / "owner.json", {"attempt": owner.attempt, "token": owner.token})

    def revoke(self) -> None:
        """Leave the job without an owner: whatever worker still lives ends itself at its next renewal."""
        with self.locked():
            write_json(self.path / "owner.json", {"attempt": 0, "token": ""})

    def check(self, owner: Owner) -> None:
        """Raise FencedError unless `owner` still owns the job."""
        if self.owner() != owner:
            raise FencedError(
                f"Attempt {owner.attempt} of job {self.path.name} was replaced by a newer one. "
                "Nothing more is written; the newer attempt goes on from the last checkpoint."
            )

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder's lock: the owner does not change meanwhile."""
        with open(self.path / "lock", "a") as lock:
            _wait_for(lock, self.path, _LOCK_WAIT_S)
            yield


def try_lock(path: Path, wait_s: float = 0.0) -> IO[str] | None:
    """Return the file, locked until it is closed or the process dies; None when another holds it.

    `is_held` takes the lock for a moment: who must not be turned away by a look waits a little.
    """
    lock = open(path, "a")
    try:
        _wait_for(lock, path, wait_s)
    except TimeoutError:
        lock.close()
        return None
    return lock


def is_held(path: Path) -> bool:
    """True while a living process holds the lock file."""
    if not path.exists():
        return False
    lock = try_lock(path)
    if lock is not None:
        lock.close()
    return lock is None


def last_lines(path: Path, most_bytes: int = 400) -> str:
    """Return the end of a log as one line, empty when there is none."""
    try:
        with open(path, "rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - most_bytes))
            return " / ".join(file.read().decode("utf-8", "replace").split("\n")).strip(" /")
    except OSError:
        return ""


def read_json(path: Path) -> dict[str, Any] | None:
    """Return a JSON file's content, or None when it is not there."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None


def beat(path: Path, count: int) -> None:
    """Show that the worker lives. Not flushed: it need not survive anything."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT, 0o644)
    try:
        os.pwrite(descriptor, f"{count:012d}".encode(), 0)
    finally:
        os.close(descriptor)


def _wait_for(lock: IO[str], path: Path, wait_s: float) -> None:
    deadline_s = time.monotonic() + wait_s
    while True:
        try:
            return fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= deadline_s:
                raise TimeoutError(
                    f"{path} stayed locked for {wait_s:g} s. A stopped process may hold it; "
                    "end that process, or wait: this is tried again."
                ) from None
            time.sleep(0.01)
