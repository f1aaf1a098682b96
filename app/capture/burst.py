"""Bursts of an open camera into an experiment's folder: one, or a sequence; kept or discarded."""

import contextlib
import signal
import threading
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from app.capture.checks import judged, noted
from app.experiment.captures import CaptureRecorder
from app.experiment.folder import Experiment, new_id
from app.files.disk_space import check_room
from app.rig.conditions import UNTOLD, Conditions, seconds_on
from drivers.burst import Burst, BurstOutcome, CapturePlan
from drivers.capture import Abort, OnProgress, run_capture
from drivers.protocols import Camera
from drivers.sequence import BurstStart, check_times, run_sequence

OnAbort = Literal["keep", "discard"]


@dataclass(frozen=True)
class TakenBurst:
    """A burst and where it is; no folder when it was discarded."""

    burst: Burst
    folder: Path | None


def take(
    camera: Camera,
    experiment: Experiment,
    plan: CapturePlan,
    on_progress: OnProgress | None = None,
    *,
    abort: Abort | None = None,
    on_abort: OnAbort = "keep",
    told: Conditions = UNTOLD,
    start: BurstStart | None = None,
) -> TakenBurst:
    """Take one burst into a new capture folder. Raises AirlensError without room for it, DeviceError."""
    rig_on_s = seconds_on(experiment.settings, told)
    check_room(experiment.folder, plan, camera.info)
    folder = experiment.captures_folder / new_id(experiment.captures_folder, plan.kind)
    recorder = CaptureRecorder(folder, plan)
    burst = run_capture(camera, plan, on_progress, on_frame=recorder.observe, abort=abort, rig_on_s=rig_on_s)
    if burst.outcome is BurstOutcome.ABORTED and on_abort == "discard":
        recorder.discard()
        return TakenBurst(burst, None)
    burst = judged(experiment, burst, told)
    origin = {"rig": experiment.settings.rig.camera_kind} | noted(experiment, told)
    origin |= {"sequence": asdict(start)} if start else {}
    return TakenBurst(burst, recorder.keep(burst, origin))


def take_sequence(
    camera: Camera,
    experiment: Experiment,
    plan: CapturePlan,
    starts_s: Sequence[float],
    on_progress: OnProgress | None = None,
    *,
    abort: Abort | None = None,
    on_abort: OnAbort = "keep",
    told: Conditions = UNTOLD,
) -> list[TakenBurst]:
    """Take a burst at each of the times. Raises DeviceSettingError for times that cannot be kept."""
    check_times(starts_s, plan.frames / camera.info.frame_rate_hz)
    taken: list[TakenBurst] = []

    def one(start: BurstStart) -> Burst:
        options = {"abort": abort, "on_abort": on_abort, "told": told, "start": start}
        taken.append(take(camera, experiment, plan, on_progress, **options))
        return taken[-1].burst

    run_sequence(starts_s, one, abort=abort)
    return taken


@contextlib.contextmanager
def interruptible() -> Iterator[Abort]:
    """Yield an abort that the first Ctrl-C sets; a second one ends the program."""
    stopped = threading.Event()
    before = signal.getsignal(signal.SIGINT)

    def stop(number: int, frame: object) -> None:
        stopped.set()
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, stop)
    try:
        yield stopped.is_set
    finally:
        signal.signal(signal.SIGINT, before)
