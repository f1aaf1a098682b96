"""The gate that every frame passes, real or simulated: what is lost, corrupt, late or stale is refused.

A driver describes each buffer by what the kernel says about it (sequence number, timestamp, error flag,
bytes filled). The gate compares it with the buffer before and counts what it refuses, by kind.
"""

import math
from collections import Counter
from dataclasses import dataclass

from drivers.errors import FrameError, FrameFault

# So many frames after a change of exposure or gain a camera obeys it; several late is usual over USB.
CONTROL_FRAMES = 8
MIN_PATIENCE_S = 1.0
# A camera whose rate is unknown may be slow.
UNKNOWN_PATIENCE_S = 5.0


@dataclass(frozen=True)
class Arrival:
    """What is known of one buffer. `exposed_s` is when its exposure began, on the monotonic clock."""

    sequence: int
    exposed_s: float
    flagged: bool
    bytes_used: int


class FrameGate:
    """Admit good frames only. `refused` counts the others by kind.

    `rate_period_s` is the time from frame to frame at short exposures; None where the driver does not say, and then
    no frame is late. `late_factor`: a frame that comes after more than this many periods a sequence step was late:
    many drivers number only the frames that they deliver, so that a loss shows in the timestamps alone.
    """

    def __init__(
        self,
        expected_bytes: int,
        rate_period_s: float | None,
        exposure_s: float | None = None,
        late_factor: float = 1.6,
    ) -> None:
        self.refused: Counter[FrameFault] = Counter()
        self.since_change: int | None = None
        """Frames from the first one after a change of exposure or gain to the last one; None before any change."""
        self._expected_bytes, self._late_factor = expected_bytes, late_factor
        self._rate_period_s, self._exposure_s = rate_period_s, exposure_s
        self._longest_before_s = 0.0
        self._first: int | None = None
        self._last: Arrival | None = None

    @property
    def period_s(self) -> float | None:
        """The time from frame to frame; None while it is unknown. A long exposure takes whole periods of the rate."""
        if self._rate_period_s is None:
            return None
        return self._rate_period_s * max(1, math.ceil((self._exposure_s or 0.0) / self._rate_period_s - 0.01))

    @property
    def longest_s(self) -> float | None:
        """The longest time from frame to frame that is due now: a change of exposure acts only some frames later."""
        return None if self.period_s is None else max(self.period_s, self._longest_before_s)

    @property
    def patience_s(self) -> float:
        """How long to wait for a frame before the camera is said to send none."""
        if self.longest_s is None:
            return UNKNOWN_PATIENCE_S + 3 * max(self._exposure_s or 0.0, self._longest_before_s)
        return max(MIN_PATIENCE_S, 3 * self.longest_s)

    def note_change(self, exposure_s: float | None) -> None:
        """Note that exposure or gain was changed. Frames of before it may come for a while."""
        self._longest_before_s = self.longest_s or self._exposure_s or 0.0
        self._exposure_s = exposure_s
        self._first, self.since_change = None, 0

    def restart(self) -> None:
        """Forget the frame before: the stream was started anew."""
        self._first = self._last = None

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
            self._count(arrival.sequence)
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
        if consecutive and self.longest_s is not None and elapsed_s > self._late_factor * self.longest_s:
            exposure = "" if self._exposure_s is None else f" at an exposure of {self._exposure_s:g} s"
            self._refuse(
                FrameFault.LATE,
                f"Frame {arrival.sequence} came {elapsed_s:.4f} s after the one before; the period is "
                f"{self.longest_s:.4f} s{exposure}. Frames were lost without being counted by the driver. Use "
                "another USB port, or shorten the exposure if this repeats.",
            )

    def _count(self, sequence: int) -> None:
        """Count the frames since the last change, if there was any."""
        if self.since_change is None:
            return
        self._first = sequence if self._first is None else self._first
        self.since_change = max(self.since_change, _steps(self._first, sequence))
        if self.since_change >= CONTROL_FRAMES:
            self._longest_before_s = 0.0

    def _refuse(self, fault: FrameFault, message: str, lost: int = 1) -> None:
        self.refused[fault] += lost
        raise FrameError(message, fault, lost)


def _steps(before: int, after: int) -> int:
    """Return how far a 32-bit frame counter went, across its wrap too."""
    return (after - before + 2**31) % 2**32 - 2**31
