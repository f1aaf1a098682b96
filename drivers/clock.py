"""Time as a thing that is handed in, so that a warm-up of 100 s can be tested in no time."""

import time
from collections.abc import Callable
from typing import Protocol, runtime_checkable

# So long a stop may go unnoticed.
SLICE_S = 0.05


@runtime_checkable
class Clock(Protocol):
    """Monotonic time in seconds."""

    def now_s(self) -> float:
        """Return seconds since an arbitrary start; never goes back."""
        ...

    def sleep_s(self, seconds: float) -> None:
        """Return `seconds` later; at once when not positive."""
        ...


class SystemClock:
    """The machine's CLOCK_MONOTONIC, which V4L2 also stamps its frames with."""

    def now_s(self) -> float:
        """Return the machine's monotonic time."""
        return time.monotonic()

    def sleep_s(self, seconds: float) -> None:
        """Sleep for real."""
        if seconds > 0:
            time.sleep(seconds)


def wait_until(clock: Clock, at_s: float, stop: Callable[[], bool]) -> None:
    """Return at `at_s`, or as soon as `stop` says so."""
    while (left_s := at_s - clock.now_s()) > 0 and not stop():
        clock.sleep_s(min(SLICE_S, left_s))
