"""Bursts at given times, for mean and time-resolved work: each starts when due, and says when it did."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.burst import Burst
from drivers.capture import Abort
from drivers.clock import Clock, SystemClock, wait_until
from drivers.errors import DeviceSettingError


@dataclass(frozen=True)
class BurstStart:
    """One burst of a sequence: its number, when it was due and when it began, in seconds from the start."""

    number: int
    due_s: float
    began_s: float


def evenly(bursts: int, every_s: float) -> tuple[float, ...]:
    """Return start times of so many bursts."""
    return tuple(number * every_s for number in range(bursts))


def check_times(starts_s: Sequence[float], burst_s: float) -> None:
    """Raise DeviceSettingError unless the times rise and leave room for a burst of `burst_s`."""
    gaps = [after - before for before, after in itertools.pairwise(starts_s)]
    if not starts_s or starts_s[0] < 0 or any(gap <= 0 for gap in gaps):
        raise DeviceSettingError(f"Start times {list(starts_s)} must rise from 0 on. Give them in order.")
    if gaps and min(gaps) < burst_s:
        raise DeviceSettingError(
            f"Bursts start {min(gaps):g} s apart, and one takes {burst_s:g} s. "
            "Take fewer frames, or leave more time between them."
        )


def run_sequence(
    starts_s: Sequence[float],
    take: Callable[[BurstStart], Burst],
    *,
    abort: Abort | None = None,
    clock: Clock | None = None,
) -> list[tuple[BurstStart, Burst]]:
    """Return the bursts that `take` took at their times; fewer when aborted between two."""
    clock, stop = clock or SystemClock(), abort or (lambda: False)
    began_s, done = clock.now_s(), []
    for number, due_s in enumerate(starts_s):
        wait_until(clock, began_s + due_s, stop)
        if stop():
            break
        start = BurstStart(number, due_s, clock.now_s() - began_s)
        done.append((start, take(start)))
    return done
