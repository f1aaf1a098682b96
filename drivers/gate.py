"""The gate that every frame passes, real or simulated: what is lost, corrupt, late or stale is refused.

A driver describes each buffer by what the kernel says about it (sequence number, timestamp, error flag,
bytes filled). The gate compares it with the buffer before and counts what it refuses, by kind.
"""

from collections import Counter
from dataclasses import dataclass

from drivers.errors import FrameError, FrameFault


@dataclass(frozen=True)
class Arrival:
    """What is known of one buffer. `exposed_s` is when its exposure began, on the monotonic clock."""

    sequence: int
    exposed_s: float
    flagged: bool
    bytes_used: int


class FrameGate:
    """Admit good frames only. `refused` counts the others by kind.

    `late_factor`: a frame that comes after more than this many periods a sequence step was late: many
    drivers number only the frames that they deliver, so that a loss shows in the timestamps alone.
    """

    def __init__(self, expected_bytes: int, period_s: float, late_factor: float = 1.6) -> None:
        self.refused: Counter[FrameFault] = Counter()
        self._expected_bytes = expected_bytes
        self._period_s = period_s
        self._late_factor = late_factor
        self._last: Arrival | None = None

    def restart(self) -> None:
        """Forget the frame before: the stream was started anew."""
        self._last = None

    def is_stale(self, arrival: Arrival, fresh_after_s: float) -> bool:
        """Return whether the exposure began before `fresh_after_s`; counted, and never an error."""
        if arrival.exposed_s >= fresh_after_s:
            return False
        self.refused[FrameFault.STALE] += 1
        self._last = arrival
        return True

    def admit(self, arrival: Arrival, *, consecutive: bool) -> None:
        """Return when the frame is good. Raises FrameError with its kind otherwise.

        With `consecutive`, frames lost since the last one are an error too.
        """
        last = self._last
        steps = 1 if last is None else _steps(last.sequence, arrival.sequence)
        if steps > 0:
            self._last = arrival
        if arrival.flagged or arrival.bytes_used < self._expected_bytes:
            self._refuse(
                FrameFault.CORRUPT,
                f"Frame {arrival.sequence} is corrupt (error flag {arrival.flagged}, {arrival.bytes_used} of "
                f"{self._expected_bytes} bytes). Check cable and USB bandwidth if this repeats.",
            )
        if last is None:
            return
        elapsed_s = arrival.exposed_s - last.exposed_s
        if steps <= 0 or elapsed_s <= 0:
            self._refuse(
                FrameFault.STALE,
                f"Frame {arrival.sequence} came after {last.sequence} ({elapsed_s:+.4f} s): an old buffer. "
                "It is refused; restart the stream if this repeats.",
            )
        if consecutive and steps > 1:
            self._refuse(
                FrameFault.DROPPED,
                f"{steps - 1} frame(s) lost before frame {arrival.sequence}. "
                "Lower the frame rate or close other programs if this repeats.",
                steps - 1,
            )
        if consecutive and elapsed_s > self._late_factor * self._period_s:
            self._refuse(
                FrameFault.LATE,
                f"Frame {arrival.sequence} came {elapsed_s:.4f} s after the one before; the period is "
                f"{self._period_s:.4f} s. Frames were lost without being counted by the driver.",
            )

    def _refuse(self, fault: FrameFault, message: str, lost: int = 1) -> None:
        self.refused[fault] += lost
        raise FrameError(message, fault, lost)


def _steps(before: int, after: int) -> int:
    """Return how far a 32-bit frame counter went, across its wrap too."""
    return (after - before + 2**31) % 2**32 - 2**31
