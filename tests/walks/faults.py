"""A machine that fails: its disk is full or read-only, its clock jumps, its process is killed between two writes.

The faults are at the edge: the calls of Python to the system, and SQLite's statements, for paths below one
folder. All that is above them is the real thing.
"""

import builtins
import contextlib
import errno
import io
import os
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

_WRITING = ("BEGIN IMMEDIATE", "INSERT", "UPDATE", "COMMIT", "CREATE", "ALTER")


class Killed(SystemExit):
    """The process ends here; a thread ends silently."""


@contextlib.contextmanager
def silent_deaths() -> Iterator[None]:
    """A thread that the fault killed has no unhandled exception: its process would be gone."""
    told = threading.excepthook
    threading.excepthook = lambda about: None if about.exc_type is Killed else told(about)
    try:
        yield
    finally:
        threading.excepthook = told


class Machine:
    """What is wrong with disk, clock and process now."""

    def __init__(self, root: Path) -> None:
        self.root = str(root)
        self.trouble: int | None = None
        self.kill_in: int | None = None
        self.dead = False
        self.clock_s = 0.0
        self.sound_for: int | None = None

    @contextlib.contextmanager
    def behind(self) -> Iterator[None]:
        """Let this thread, another program's hand, find the disk sound and be killed by nothing."""
        self.sound_for = threading.get_ident()
        try:
            yield
        finally:
            self.sound_for = None

    def touch(self, *paths: Any, creates: bool) -> None:
        """Fail as the system would when something below the root is changed; `creates` needs space."""
        if self.sound_for == threading.get_ident():
            return
        if not any(str(path).startswith(self.root) for path in paths):
            return
        left = self.kill_in
        if left is not None:
            self.kill_in = left - 1
            self.dead = self.dead or left < 1
        if self.dead:
            raise Killed
        if self.trouble == errno.EROFS or (self.trouble == errno.ENOSPC and creates):
            raise OSError(self.trouble, os.strerror(self.trouble), str(paths[0]))

    def statement(self, sql: str) -> None:
        """Fail as SQLite would."""
        if not sql.lstrip().upper().startswith(_WRITING):
            return
        try:
            self.touch(self.root, creates=True)
        except OSError as error:
            full = error.errno == errno.ENOSPC
            text = "database or disk is full" if full else "attempt to write a readonly database"
            raise sqlite3.OperationalError(text) from None

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Put the faults between this process and the system."""
        machine, wall_s, connect = self, time.time, sqlite3.connect

        class Connection(sqlite3.Connection):
            def execute(self, sql: str, *values: Any) -> sqlite3.Cursor:
                machine.statement(sql)
                return super().execute(sql, *values)

        changed = [
            (time, "time", lambda: wall_s() + self.clock_s),
            (sqlite3, "connect", lambda *a, **b: connect(*a, **b, factory=Connection)),
            (builtins, "open", self._opening(builtins.open)),
            (io, "open", self._opening(io.open)),
            (os, "open", self._low_opening(os.open)),
            *((os, name, self._changing(getattr(os, name), True)) for name in ("mkdir",)),
            *(
                (os, name, self._changing(getattr(os, name), False))
                for name in ("rename", "replace", "unlink", "rmdir")
            ),
        ]
        before = [(place, name, getattr(place, name)) for place, name, _ in changed]
        for place, name, new in changed:
            setattr(place, name, new)
        try:
            yield
        finally:
            for place, name, old in before:
                setattr(place, name, old)

    def _opening(self, system: Callable[..., Any]) -> Callable[..., Any]:
        def opened(file: Any, mode: str = "r", *rest: Any, **named: Any) -> Any:
            if set(mode) & set("wax+") and not isinstance(file, int):
                grows = not set(mode) & set("a+") or not os.path.exists(file)
                self.touch(file, creates=grows)
            return system(file, mode, *rest, **named)

        return opened

    def _low_opening(self, system: Callable[..., int]) -> Callable[..., int]:
        def opened(path: Any, flags: int, *rest: Any, **named: Any) -> int:
            if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
                self.touch(path, creates=bool(flags & os.O_CREAT) and not os.path.exists(path))
            return system(path, flags, *rest, **named)

        return opened

    def _changing(self, system: Callable[..., Any], creates: bool) -> Callable[..., Any]:
        def change(path: Any, *rest: Any, **named: Any) -> Any:
            # A path that is relative to an open folder is a removal that began at a whole one.
            self.touch(path, creates=creates)
            return system(path, *rest, **named)

        return change
