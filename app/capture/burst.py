"""One burst of an open camera, taken and kept: the same few lines whoever asks.

The command line, the service and `simulate` call `take` (or `take_order`, for a sequence): disk space, id,
record, run, judge, origin, keep. A calibration takes its pictures with `shoot`, which is the burst alone.
"""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from app.capture.checks import judged
from app.experiment.captures import CaptureRecorder
from app.experiment.folder import Experiment, new_id
from app.files.disk_space import check_room
from app.rig.conditions import UNTOLD, Conditions, conditions_of, known_pairs, seconds_on
from app.rig.open import air_of, clock_of, open_camera
from drivers.burst import Burst, BurstOutcome, CapturePlan
from drivers.capture import Abort, OnFrame, OnProgress, Taken, run_capture
from drivers.errors import DeviceSettingError
from drivers.protocols import Camera
from drivers.sequence import BurstStart, check_times, evenly, run_sequence
from drivers.verdict import Verdict

OnAbort = Literal["keep", "discard"]


@dataclass(frozen=True)
class Order:
    """What is asked for: a burst, or several `every_s` from start to start; and what the operator states."""

    plan: CapturePlan
    bursts: int = 1
    every_s: float = 0.0
    told: Conditions = UNTOLD

    def __post_init__(self) -> None:
        if self.bursts < 1 or (self.bursts > 1 and not self.every_s > 0):
            raise DeviceSettingError(
                f"bursts is {self.bursts} and every_s is {self.every_s:g}; expected one burst, or several with "
                "the time from start to start."
            )


@dataclass(frozen=True)
class BurstWatch:
    """Who follows a burst: hears of every frame, and ends it by saying what becomes of the frames so far.

    `begun` hears of the folder of every new capture.
    """

    progress: OnProgress | None = None
    frame: OnFrame | None = None
    stop: Callable[[], OnAbort | None] = lambda: None
    begun: Callable[[Path], object] = lambda folder: None


@dataclass(frozen=True)
class TakenBurst:
    """A burst and where it is; no folder when it was discarded."""

    burst: Burst
    folder: Path | None

    @property
    def shortfall(self) -> str:
        """Why this is not what was asked for, and what to do; empty when it is."""
        if self.burst.outcome is BurstOutcome.COMPLETE:
            return ""
        kept = "They were discarded, as asked."
        if self.folder is not None:
            kept = f"They are kept in {self.folder.name}, marked as incomplete."
        return (
            f"The {self.burst.plan.role} capture ended early ({self.burst.outcome.value}) after "
            f"{self.burst.frames} of {self.burst.plan.frames} frames. {kept} Take it again."
        )


_UNWATCHED = BurstWatch()


def take(
    camera: Camera,
    experiment: Experiment,
    plan: CapturePlan,
    told: Conditions = UNTOLD,
    watch: BurstWatch = _UNWATCHED,
    *,
    sequence: dict[str, Any] | None = None,
    name: str | None = None,
    source: Mapping[str, Any] | None = None,
    known: tuple[Verdict, ...] = (),
    series: Mapping[str, Any] | None = None,
    moment: int | None = None,
) -> TakenBurst:
    """Take one burst into a new folder below captures/, by `name` where that was given out already.

    The cameras of further views are opened one after the other once the first has ended, and all pictures are one
    capture; what is said of it is said of all. A raw stack is kept of the first. `moment` is as in `open_camera`.
    `sequence` says which burst of how many it is. `source` says where the frames come from, where that is not the
    rig; `known` are verdicts that the frames cannot tell; `series` is its place between two references. Raises
    AirlensError without room for it, DeviceError.
    """
    check_room(experiment.folder, plan, camera.info)
    name = name or new_id(experiment.captures_folder, plan.role)
    recorder = CaptureRecorder(experiment.captures_folder / name, plan)
    watch.begun(recorder.folder)
    try:
        views = len(experiment.settings.scene.views) if source is None else 1
        bursts = [_run(camera, plan, watch, recorder.observe, seconds_on(experiment.settings, told))]
        if views > 1:
            bursts += _of_other_views(bursts[0], experiment, plan, told, watch, moment)
        if bursts[-1].outcome is BurstOutcome.ABORTED and watch.stop() == "discard":
            recorder.discard()
            return TakenBurst(bursts[-1], None)
        bursts[0] = replace(bursts[0], verdicts=(*bursts[0].verdicts, *known))
        bursts = [judged(experiment, burst, told, view) for view, burst in enumerate(bursts)]
        origin = dict(source) if source is not None else _rig(experiment, plan)
        origin |= known_pairs(conditions_of(experiment.settings, told))
        origin |= {} if sequence is None else {"sequence": sequence}
        origin |= {} if series is None else {"series": dict(series)}
        return TakenBurst(_together(bursts, experiment), recorder.keep(bursts, origin, views))
    except BaseException:
        recorder.leave()
        raise


def _of_other_views(
    first: Burst,
    experiment: Experiment,
    plan: CapturePlan,
    told: Conditions,
    watch: BurstWatch,
    moment: int | None,
) -> list[Burst]:
    """The bursts of the views after the first, until one is not complete."""
    bursts = [first]
    for view in range(1, len(experiment.settings.scene.views)):
        if bursts[-1].outcome is not BurstOutcome.COMPLETE:
            break
        with open_camera(experiment, air_of(plan.role), view, moment) as camera:
            seconds = seconds_on(experiment.settings, told)
            bursts.append(_run(camera, plan, watch, lambda taken: None, seconds))
    return bursts[1:]


def _together(bursts: list[Burst], experiment: Experiment) -> Burst:
    """The burst that stands for those of all views: the first, or one that ended early, with the verdicts of all."""
    if len(bursts) == 1:
        return bursts[0]
    names = [view.name for view in experiment.settings.scene.views]
    verdicts = [
        replace(verdict, name=f"{name}: {verdict.name}")
        for name, burst in zip(names, bursts, strict=False)
        for verdict in burst.verdicts
    ]
    whole = bursts[-1].outcome is BurstOutcome.COMPLETE
    return replace(bursts[0 if whole else -1], verdicts=tuple(verdicts))


def take_order(
    camera: Camera,
    experiment: Experiment,
    order: Order,
    watch: BurstWatch = _UNWATCHED,
    name: str | None = None,
) -> list[TakenBurst]:
    """Take every burst of an order, the first by `name`; fewer when it is stopped.

    Raises DeviceSettingError for times that cannot be kept.
    """
    starts_s = evenly(order.bursts, order.every_s)
    check_times(starts_s, order.plan.frames / camera.info.frame_rate_hz)
    taken: list[TakenBurst] = []
    name = name or new_id(experiment.captures_folder, order.plan.role)

    def one(start: BurstStart) -> Burst:
        sequence = None
        if order.bursts > 1:
            sequence = {"id": name} | asdict(start) | {"bursts": order.bursts, "every_s": order.every_s}
        own = name if start.number == 0 else None
        taken.append(take(camera, experiment, order.plan, order.told, watch, sequence=sequence, name=own))
        return taken[-1].burst

    run_sequence(starts_s, one, abort=lambda: watch.stop() is not None, clock=clock_of(camera))
    return taken


def shoot(camera: Camera, where: Path, plan: CapturePlan, watch: BurstWatch = _UNWATCHED) -> Burst:
    """Take a burst that becomes no capture. Raises AirlensError without room for it at `where`, DeviceError."""
    check_room(where, plan, camera.info)
    return _run(camera, plan, watch, lambda taken: None, None)


def _run(
    camera: Camera, plan: CapturePlan, watch: BurstWatch, keep: OnFrame, rig_on_s: float | None
) -> Burst:
    def follow(taken: Taken) -> None:
        keep(taken)
        if watch.frame is not None:
            watch.frame(taken)

    return run_capture(
        camera,
        plan,
        watch.progress,
        on_frame=follow,
        abort=lambda: watch.stop() is not None,
        rig_on_s=rig_on_s,
    )


def _rig(experiment: Experiment, plan: CapturePlan) -> dict[str, Any]:
    """Which rig took it, and what a simulated room did."""
    kind = experiment.settings.rig.camera_kind
    return {"rig": kind, "air": air_of(plan.role)} if kind == "simulated" else {"rig": kind}


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
