"""What went over the line, as a person can read it: time, direction, text with control bytes spelled out."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class WireEntry:
    """One piece of traffic. `direction` is '>' sent, '<' received, '!' a remark."""

    at_s: float
    direction: str
    data: bytes

    @property
    def text(self) -> str:
        """The bytes: printable text as it is, all else as \\xNN."""
        shown = self.data.decode("ascii", "backslashreplace")
        return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in shown)

    def __str__(self) -> str:
        moment = time.strftime("%H:%M:%S", time.localtime(self.at_s)) + f".{int(self.at_s % 1 * 1000):03d}"
        return f"{moment} {self.direction} {self.text}"


class WireLog:
    """The latest traffic; `listen` is called with each new entry."""

    def __init__(self, length: int = 1000, listen: Callable[[WireEntry], object] | None = None) -> None:
        self._entries: deque[WireEntry] = deque(maxlen=length)
        self._listen = listen

    @property
    def entries(self) -> tuple[WireEntry, ...]:
        """Oldest first."""
        return tuple(self._entries)

    def add(self, direction: str, data: bytes) -> None:
        """Note a piece of traffic; empty ones are not worth a line."""
        if not data:
            return
        entry = WireEntry(time.time(), direction, data)
        self._entries.append(entry)
        if self._listen:
            self._listen(entry)
