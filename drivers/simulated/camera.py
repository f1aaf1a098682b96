"""A camera that sees whatever its injected view shows: photons, noise, buffers, and scripted mishaps.

It knows no optics. `view()` returns luminance, 1 of which fills the well at `full_well_exposure_s`, or at the
exposure that the camera was made with. Return the same array object while nothing changed: the expected counts are
then reused. `moving(time_s)` takes its place where what is seen changes with the time since the camera was made.
"""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError, DeviceSettingError, DeviceTimeoutError
from drivers.gate import Arrival, FrameGate
from drivers.protocols import CameraInfo, Frame, Pixels
from drivers.shift import shift_image
from drivers.simulated.clock import VirtualClock
from drivers.simulated.faults import CameraFault, FaultScript, no_faults
from drivers.simulated.sensor import ExpectedCounts, Luminance, SensorNoise

TIMEOUT_S = 2.0
BUFFERS = 4
# So many frames after a change of exposure or gain are still taken as before, as many UVC cameras do.
LATENCY_FRAMES = 5
_THREADED_FROM_PX = 1_000_000


class SimulatedCamera:
    """The twin of a V4L2 camera, behind the same Protocol.

    `shift_px` = (columns, rows) may be set between exposures: drift of the whole image, exact to a small
    part of a pixel. `flicker` is the share (rms) by which the light changes from frame to frame. Without a `clock` of
    the system's, time is simulated and no grab waits. A new exposure or gain acts `LATENCY_FRAMES` late.
    """

    def __init__(
        self,
        view: Callable[[], Luminance],
        *,
        seed: int,
        noise: SensorNoise | None = None,
        exposure_s: float = 1 / 60,
        full_well_exposure_s: float | None = None,
        frame_rate_hz: float = 30.0,
        clock: Clock | None = None,
        faults: FaultScript = no_faults,
        flicker: float = 0.0,
        moving: Callable[[float], Luminance] | None = None,
        name: str = "simulated camera",
    ) -> None:
        self.shift_px = (0.0, 0.0)
        self._view, self._moving, self._seed, self._noise = view, moving, seed, noise or SensorNoise()
        self._exposure_s, self._full_well_exposure_s = exposure_s, full_well_exposure_s or exposure_s
        self._gain, self._frame_rate_hz, self._name = 1.0, frame_rate_hz, name
        self._before, self._acts_from = (exposure_s, 1.0), 0
        self._clock, self._faults, self._flicker = clock or VirtualClock(), faults, flicker
        self._luminance = view()
        self._made_s = self._clock.now_s()
        self._expected: tuple[object, ExpectedCounts] | None = None
        self._threads: ThreadPoolExecutor | None = None
        self._start()

    @property
    def clock(self) -> Clock:
        """The time that this camera lives in."""
        return self._clock

    @property
    def info(self) -> CameraInfo:
        """Identity, size and settings."""
        rows, cols = self._luminance.shape
        settings: dict[str, float | int | str] = {
            "exposure_s": self._exposure_s,
            "gain": self._gain,
            "full_well_e": self._noise.full_well_e,
            "read_noise_e": self._noise.read_noise_e,
        }
        return CameraInfo(self._name, cols, rows, self._noise.bits, 1 / self._period_s, settings)

    @property
    def exposure_s(self) -> float:
        """Exposure time."""
        return self._exposure_s

    @exposure_s.setter
    def exposure_s(self, value: float) -> None:
        if not 1e-6 <= value <= 10.0:
            raise DeviceSettingError(f"Exposure {value:g} s is not possible; expected 1e-06 to 10 s.")
        if value == self._exposure_s:
            return
        before = self._in_force(self._next)
        self._exposure_s = value
        self._begin()
        self._change(before)

    @property
    def gain(self) -> float:
        """Linear gain, 1 to 16."""
        return self._gain

    @gain.setter
    def gain(self, value: float) -> None:
        if not 1.0 <= value <= 16.0:
            raise DeviceSettingError(f"Gain {value:g} is not possible; expected 1 to 16.")
        if value == self._gain:
            return
        before = self._in_force(self._next)
        self._gain = value
        self._change(before)

    @property
    def gate(self) -> FrameGate:
        """The gate, with its counts of refused frames."""
        return self._gate

    def grab(self) -> Frame:
        """Return the next frame whose exposure begins after this call."""
        called_s = self._clock.now_s()
        # A hair of tolerance: in simulated time the next frame begins at this very instant.
        self._next = max(self._next, math.ceil((called_s - self._started_s) / self._period_s - 1e-9))
        return self._receive(called_s - 1e-9 * self._period_s)

    def follow(self) -> Frame:
        """Return the frame after the last one; frames that a slow reader let overflow are lost."""
        elapsed_s = self._clock.now_s() - self._started_s
        self._next = max(self._next, int(elapsed_s / self._period_s) - BUFFERS)
        return self._receive(None)

    def reconnect(self) -> None:
        """Open again after an unplug or a close."""
        self._start()

    def close(self) -> None:
        """Free the threads."""
        if self._threads is not None:
            self._threads.shutdown()
        self._threads = None

    def __enter__(self) -> "SimulatedCamera":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def expected(self, sequence: int) -> Pixels:
        """Return what frame `sequence` of the present view looks like when nothing goes wrong."""
        return self._draw(sequence)

    def _start(self) -> None:
        size = self._luminance.size * np.dtype(self._noise.dtype).itemsize
        self._gate = FrameGate(size, 1 / self._frame_rate_hz, self._exposure_s)
        self._acts_from, self._gone = 0, False
        self._begin()

    def _begin(self) -> None:
        """Begin to count frames anew; an exposure that is longer than the period stretches it."""
        self._period_s = max(1 / self._frame_rate_hz, self._exposure_s)
        self._started_s = self._clock.now_s()
        self._next, self._uncounted = 0, 0
        self._gate.restart()

    def _change(self, before: tuple[float, float]) -> None:
        self._before, self._acts_from = before, self._next + LATENCY_FRAMES
        self._gate.note_change(self._exposure_s)

    def _in_force(self, index: int) -> tuple[float, float]:
        """Exposure and gain that a frame is taken with."""
        return (self._exposure_s, self._gain) if index >= self._acts_from else self._before

    def _receive(self, fresh_after_s: float | None) -> Frame:
        """Return the next buffer that is fresh enough; with None, the next buffer must be consecutive."""
        while True:
            index, arrival, damaged = self._deliver()
            if fresh_after_s is None or not self._gate.is_stale(arrival, fresh_after_s):
                break
        self._gate.admit(arrival, consecutive=fresh_after_s is None)
        pixels = self._draw(index)
        if damaged:  # never reached while the gate does its work
            pixels[len(pixels) // 2 :] = 0
        full_scale = self._noise.full_scale_counts
        return Frame(pixels, arrival.sequence, arrival.exposed_s, full_scale, self._gate.since_change)

    def _deliver(self) -> tuple[int, Arrival, bool]:
        """Return the number of the next frame that reaches the buffers, and what the buffer says."""
        if self._gone:
            raise DeviceNotFoundError(f"{self._name} is unplugged. Plug it in, then reconnect.")
        index, fault = self._next, self._faults(self._next)
        while fault in (CameraFault.DROP, CameraFault.SILENT_DROP):
            self._uncounted += fault is CameraFault.SILENT_DROP
            index += 1
            fault = self._faults(index)
        self._next = index + 1
        self._raise_if_away(fault)
        self._clock.sleep_s(self._started_s + index * self._period_s + self._exposure_s - self._clock.now_s())
        index -= fault is CameraFault.OLD_BUFFER and index > 0
        size = self._luminance.size * np.dtype(self._noise.dtype).itemsize
        bytes_used = size // 2 if fault is CameraFault.SHORT else size
        exposed_s = self._started_s + index * self._period_s
        flagged = fault is CameraFault.ERROR_FLAG
        arrival = Arrival(index - self._uncounted, exposed_s, flagged, bytes_used)
        return index, arrival, flagged or fault is CameraFault.SHORT

    def _raise_if_away(self, fault: CameraFault | None) -> None:
        if fault is CameraFault.STALL:
            self._clock.sleep_s(TIMEOUT_S)
            raise DeviceTimeoutError(
                f"{self._name} sent no frame within {TIMEOUT_S:g} s. "
                "Check the cable; then take the burst again."
            )
        if fault is CameraFault.UNPLUG:
            self._gone = True
            raise DeviceNotFoundError(f"{self._name} was unplugged. Plug it in, then reconnect.")

    def _draw(self, index: int) -> Pixels:
        luminance = self._view() if self._moving is None else self._moving(self._age_s(index))
        if luminance.shape != self._luminance.shape:
            raise DeviceSettingError(
                f"The view is now {luminance.shape} instead of {self._luminance.shape} (rows, columns). "
                "A camera keeps its size: make a new one for a new size."
            )
        exposure_s, gain = self._in_force(index)
        key = (id(luminance), exposure_s, gain, self.shift_px)
        if self._expected is None or self._expected[0] != key:
            moved = luminance if self.shift_px == (0.0, 0.0) else shift_image(luminance, self.shift_px)
            factor = exposure_s / self._full_well_exposure_s
            self._expected = key, ExpectedCounts.of(moved, self._noise, factor, gain)
            self._luminance = luminance  # held, so that its id is not given to another array
        brightness = self._brightness(index)
        if luminance.size < _THREADED_FROM_PX:
            return self._expected[1].draw(self._seed, index, brightness=brightness)
        if self._threads is None:
            self._threads = ThreadPoolExecutor(min(4, os.cpu_count() or 1), "simulated-camera")
        return self._expected[1].draw(self._seed, index, self._threads, brightness)

    def _age_s(self, index: int) -> float:
        """When a frame begins, since the camera was made."""
        return self._started_s + index * self._period_s - self._made_s

    def _brightness(self, index: int) -> float:
        """The light of a frame; the same at every call."""
        if self._flicker == 0.0:
            return 1.0
        return max(
            0.0, 1.0 + self._flicker * float(np.random.default_rng([self._seed, index]).standard_normal())
        )
