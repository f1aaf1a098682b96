"""Simulated time: sleeping costs nothing, so a run of an hour of warm-up takes no longer than its frames."""

import threading


class VirtualClock:
    """A clock that moves only when somebody sleeps on it (or calls `advance_s`)."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s
        self._lock = threading.Lock()

    def now_s(self) -> float:
        """Return the simulated time."""
        return self._now_s

    def sleep_s(self, seconds: float) -> None:
        """Let simulated time pass, at once."""
        if seconds > 0:
            self.advance_s(seconds)

    def advance_s(self, seconds: float) -> None:
        """Move time on by `seconds`."""
        with self._lock:
            self._now_s += seconds
