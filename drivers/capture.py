"""Take a burst: settle, then mean and variance of good frames only, one after another at the camera's rate.

Frames that were lost, late or corrupt are refused by the camera's gate, counted here and taken again. An
abort acts within a frame. Whatever ends a burst early, what was taken before is handed back and says so.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.burst import Burst, BurstOutcome, CapturePlan, FrameRecord, Progress
from drivers.clock import Clock, SystemClock, wait_until
from drivers.errors import DeviceNotFoundError, DeviceTimeoutError, FrameError, FrameFault
from drivers.moments import RunningMoments
from drivers.protocols import Camera, CameraInfo, Frame
from drivers.saturation import saturated_share
from drivers.settings import Setting, check_granted, held, is_settled
from drivers.verdict import (
    Verdict,
    judge_beat,
    judge_dark,
    judge_flicker,
    judge_images,
    judge_level,
    judge_refused,
    judge_saturation,
    judge_warm_up,
)

OnProgress = Callable[[Progress], object]
Abort = Callable[[], bool]

# Two frames in a row are equally bright when their levels differ by no more than this part.
SETTLE_TOLERANCE = 0.002


@dataclass(frozen=True)
class Taken:
    """One good frame, its record, and the moments with it in: for a raw stack or a checkpoint."""

    frame: Frame
    record: FrameRecord
    moments: RunningMoments


OnFrame = Callable[[Taken], object]


def run_capture(
    camera: Camera,
    plan: CapturePlan,
    on_progress: OnProgress | None = None,
    *,
    on_frame: OnFrame | None = None,
    abort: Abort | None = None,
    clock: Clock | None = None,
    rig_on_s: float | None = None,
    ready: Callable[[], object] | None = None,
) -> Burst:
    """Return the burst that `plan` asks for; `burst.outcome` says whether it is whole.

    `on_frame` receives every good frame; `rig_on_s` is how long the rig has been on. `ready` is called once the
    camera has settled, and the frames begin when it returns: so several bursts begin together.
    Raises DeviceSettingError when a setting is not granted, DeviceError when not even one frame came.
    """
    clock, stop = clock or SystemClock(), abort or (lambda: False)
    with held(camera, plan.exposure_s, plan.gain) as settings:
        check_granted(settings)
        info = camera.info  # now, for a camera that is lost meanwhile tells nothing
        wait_until(clock, clock.now_s() + plan.settle_s, stop)
        taker = _Taker(camera, plan, stop)
        settled = _settle(taker, plan)
        if ready is not None:
            ready()
            taker.refresh()
        frames = _take_frames(taker, plan, on_progress, on_frame)
        if not frames.records and taker.lost is not None:
            raise taker.lost
        return _burst(info, plan, settings, taker, frames, settled, rig_on_s)


@dataclass
class _Frames:
    """What was taken: sums of pixels, and one record a frame."""

    moments: RunningMoments
    records: list[FrameRecord]
    full_scale_counts: int = 1


def _take_frames(
    taker: "_Taker", plan: CapturePlan, on_progress: OnProgress | None, on_frame: OnFrame | None
) -> _Frames:
    frames = _Frames(RunningMoments(), [])
    while taker.outcome is BurstOutcome.COMPLETE and len(frames.records) < plan.frames:
        frame = taker.take()
        if frame is None:
            continue
        record = _record(frame)
        frames.moments.add(frame.pixels)
        frames.records.append(record)
        frames.full_scale_counts = frame.full_scale_counts
        if on_frame:
            on_frame(Taken(frame, record, frames.moments))
        if on_progress:
            on_progress(Progress(len(frames.records), plan.frames, taker.refused.total(), record.level))
    return frames


def _burst(
    camera: CameraInfo,
    plan: CapturePlan,
    settings: tuple[Setting, ...],
    taker: "_Taker",
    frames: _Frames,
    settled: tuple[Verdict, ...],
    rig_on_s: float | None,
) -> Burst:
    moments, records, full_scale = frames.moments, frames.records, frames.full_scale_counts
    if not records:
        moments.add(np.zeros((camera.height_px, camera.width_px), np.uint16))
    mean, std = moments.mean(full_scale), moments.std(full_scale)
    judged = (
        *settled,
        *_judge_moments(mean, std, plan, len(records)),
        *_judge_records(records, plan, settings[0].granted, taker.refused.total(), rig_on_s),
    )
    refused = {str(fault): count for fault, count in taker.refused.items()}
    return Burst(
        mean, std, plan, taker.outcome, camera, full_scale, settings, tuple(records), refused, judged
    )


class _Taker:
    """Takes good frames and counts the others; `outcome` leaves COMPLETE when the burst cannot go on."""

    def __init__(self, camera: Camera, plan: CapturePlan, abort: Abort) -> None:
        self.outcome = BurstOutcome.COMPLETE
        self.refused: Counter[FrameFault] = Counter()
        self.lost: Exception | None = None
        self._camera, self._abort, self._max_refused = camera, abort, plan.max_refused
        self._fresh = True

    def refresh(self) -> None:
        """Let the next frame be one whose exposure begins from now on: others may be waiting in the buffers."""
        self._fresh = True

    def take(self) -> Frame | None:
        """Return the next frame, or None when it was refused or the burst ended."""
        if self._abort():
            self.outcome = BurstOutcome.ABORTED
            return None
        try:
            frame = self._camera.grab() if self._fresh else self._camera.follow()
            self._fresh = False
            return frame
        except FrameError as error:
            self._refuse(error.fault, error.lost, error)
        except DeviceTimeoutError as error:
            self._fresh = True
            self._refuse(FrameFault.MISSING, 1, error)
        except DeviceNotFoundError as error:
            self.outcome, self.lost = BurstOutcome.DEVICE_LOST, error
        return None

    def _refuse(self, fault: FrameFault, lost: int, error: Exception) -> None:
        self.refused[fault] += lost
        if self.refused.total() > self._max_refused:
            self.outcome, self.lost = BurstOutcome.TOO_MANY_REFUSED, error


def _settle(taker: _Taker, plan: CapturePlan) -> tuple[Verdict, ...]:
    """Discard frames until two in a row have the same brightness; cameras differ in how long that takes.

    Two that came before a change of exposure acted are alike too, so the frames right after one are not compared.
    """
    before, change = None, float("inf")
    for _ in range(plan.settle_frames):
        if taker.outcome is not BurstOutcome.COMPLETE:
            return ()
        frame = taker.take()
        if frame is None or not is_settled(frame):
            continue
        level = _record(frame).level
        change = abs(level - before) / max(level, 1e-9) if before is not None else change
        if change <= SETTLE_TOLERANCE:
            return ()
        before = level
    if plan.settle_frames < 2:
        return ()
    advice = "Switch automatic exposure, gain and dynamic iris off; wait until the projector is steady."
    return (
        Verdict("settling", False, change, f"two frames alike to {SETTLE_TOLERANCE:g} of the level", advice),
    )


def _record(frame: Frame) -> FrameRecord:
    stride = 4 if frame.pixels.size > 1_000_000 else 1
    sample = frame.pixels[::stride, ::stride]
    level = float(sample.mean()) / frame.full_scale_counts
    return FrameRecord(frame.sequence, frame.timestamp_s, level, saturated_share(frame))


def _judge_moments(mean: np.ndarray, std: np.ndarray, plan: CapturePlan, frames: int) -> tuple[Verdict, ...]:
    if frames == 0:
        return ()
    if plan.role == "dark":
        return (judge_dark(mean),)
    if plan.role == "flat":
        return (judge_level(mean),)
    return judge_images(mean, std, frames)


def _judge_records(
    records: list[FrameRecord],
    plan: CapturePlan,
    exposure_s: float | None,
    refused: int,
    rig_on_s: float | None,
) -> list[Verdict]:
    verdicts = [
        judge_saturation([record.saturated for record in records], exposure_s),
        judge_flicker([record.level for record in records]),
        judge_refused(refused, len(records)),
    ]
    if plan.refresh_hz is not None and exposure_s is not None:
        verdicts.append(judge_beat(exposure_s, plan.refresh_hz))
    if rig_on_s is not None:
        verdicts.append(judge_warm_up(rig_on_s))
    return verdicts
