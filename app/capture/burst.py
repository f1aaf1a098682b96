"""One burst of an open camera, taken and kept: the same few lines whoever asks.

The command line, the service and `simulate` call `take` (or `take_order`, for a sequence): disk space, id,
record, run, judge, origin, keep. A calibration takes its pictures with `shoot`, which is the burst alone.
"""

import contextlib
import shlex
import signal
import threading
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from app.capture.checks import judged
from app.capture.views import OpensView, ViewCapture, together
from app.capture.watched import UNWATCHED, BurstWatch, run_watched
from app.errors import BadInputError
from app.experiment.folder import Experiment, new_id
from app.experiment.recorder import CaptureRecorder
from app.experiment.views import take_turns, view_names
from app.files.disk_space import check_room
from app.rig.conditions import UNTOLD, Conditions, conditions_of, known_pairs, seconds_on
from app.rig.lamps import Lamps
from app.rig.open import air_of, clock_of, open_camera
from drivers.burst import Burst, BurstOutcome, CapturePlan
from drivers.capture import Abort
from drivers.errors import DeviceSettingError
from drivers.protocols import Camera
from drivers.sequence import BurstStart, check_times, evenly, run_sequence
from drivers.verdict import Verdict

# In the origin of a capture of several views: whether they were taken at once, and how far apart in time.
CAMERAS = "cameras"


@dataclass(frozen=True)
class Order:
    """What is asked for: a burst, or several `every_s` from start to start; and what the operator states.

    `at_once`: the cameras of several views take theirs at the same time, else in turn.
    `live` asks for T of each burst as it comes; the captures are the same without.
    """

    plan: CapturePlan
    bursts: int = 1
    every_s: float = 0.0
    told: Conditions = UNTOLD
    at_once: bool = False
    live: bool = False

    def __post_init__(self) -> None:
        if self.bursts < 1 or (self.bursts > 1 and not self.every_s > 0):
            raise DeviceSettingError(
                f"bursts is {self.bursts} and every_s is {self.every_s:g}; expected one burst, or several with "
                "the time from start to start."
            )


@dataclass(frozen=True)
class TakenBurst:
    """A burst and where it is; no folder when it was discarded.

    Of several views `burst` stands for all, `failed` says by a view's name why it has no picture, and `any_whole`
    whether another one has.
    """

    burst: Burst
    folder: Path | None
    failed: Mapping[str, str] = field(default_factory=dict)
    any_whole: bool = True

    @property
    def shortfall(self) -> str:
        """Why this is not what was asked for, and what to do; empty when it is."""
        role, outcome = self.burst.plan.role, self.burst.outcome
        if self.failed and self.folder is not None and outcome is not BurstOutcome.ABORTED:
            missing = ", ".join(map(repr, self.failed))
            reasons = " ".join(f"{name}: {_sentence(reason)}" for name, reason in self.failed.items())
            lacks = f"The {role} capture {self.folder.name} lacks the pictures of {missing}. {reasons}"
            if not self.any_whole:
                return f"{lacks} No camera's picture is whole: take it again."
            view = shlex.quote(next(iter(self.failed)))
            return (
                f"{lacks} What the other cameras took is kept: airlens capture retake "
                f"{_experiment_of(self.folder)} --view {view} takes that camera's alone."
            )
        if outcome is BurstOutcome.COMPLETE:
            return ""
        kept = "They were discarded, as asked."
        if self.folder is not None:
            kept = f"They are kept in {self.folder.name}, marked as incomplete."
        ended = (
            f"The {role} capture ended early ({outcome.value}) after {self.burst.frames} of "
            f"{self.burst.plan.frames} frames."
        )
        return " ".join(filter(None, (ended, kept, outcome.advice, "Take it again.")))


def _sentence(text: str) -> str:
    return text if text.endswith(".") else f"{text}."


def _experiment_of(capture: Path) -> str:
    return shlex.quote(str(capture.parent.parent))


def take(
    camera: Camera,
    experiment: Experiment,
    plan: CapturePlan,
    told: Conditions = UNTOLD,
    watch: BurstWatch = UNWATCHED,
    *,
    sequence: dict[str, Any] | None = None,
    name: str | None = None,
    source: Mapping[str, Any] | None = None,
    known: tuple[Verdict, ...] = (),
    series: Mapping[str, Any] | None = None,
    moment: int | None = None,
    at_once: bool = False,
    opens: OpensView | None = None,
    lamps: Lamps | None = None,
) -> TakenBurst:
    """Take one burst into a new folder below captures/, by `name` where that was given out already.

    The cameras of further views, opened by `opens`, take theirs in turn once the first has ended, or `at_once`, and
    all pictures are one capture. One that fails is named by `failed`, and what the others took is kept. `lamps` are
    the projectors that light one wall in turn. A raw stack is kept of the first. `moment` is as in `open_camera`;
    `sequence` says which burst of how many it is; `source` says where the frames come from, where that is not the
    rig; `known` are verdicts that the frames cannot tell; `series` is its place between two references. Raises
    AirlensError without room for it, DeviceError.
    """
    check_room(experiment.folder, plan, camera.info)
    if at_once and take_turns(experiment):
        raise BadInputError(
            "One camera takes the pictures of several views here, under one projector after the other: that is in "
            "turn, not at once. Leave at_once out."
        )
    name = name or new_id(experiment.captures_folder, plan.role)
    recorder = CaptureRecorder(experiment.captures_folder / name, plan)
    watch.begun(recorder.folder)
    try:
        origin = dict(source) if source is not None else origin_of(experiment, plan)
        origin |= known_pairs(conditions_of(experiment.settings, told))
        origin |= {} if sequence is None else {"sequence": sequence}
        origin |= {} if series is None else {"series": dict(series)}
        if source is None and len(experiment.settings.scene.views) > 1:
            opens = opens or (lambda view: open_camera(experiment, air_of(plan.role), view, moment))
            cameras = ViewCapture(experiment, camera, opens, plan, told, watch, recorder.observe, lamps)
            return _take_views(cameras, recorder, origin, at_once)
        burst = run_watched(camera, plan, watch, recorder.observe, seconds_on(experiment.settings, told))
        if burst.outcome is BurstOutcome.ABORTED and watch.stop() == "discard":
            recorder.discard()
            return TakenBurst(burst, None)
        burst = judged(experiment, replace(burst, verdicts=(*burst.verdicts, *known)), told)
        return TakenBurst(burst, recorder.keep(burst, origin))
    except BaseException:
        recorder.leave()
        raise


def _take_views(
    cameras: ViewCapture, recorder: CaptureRecorder, origin: Mapping[str, Any], at_once: bool
) -> TakenBurst:
    """The bursts of all views as one capture. Raises what the first camera raised where none took a frame."""
    experiment, watch = cameras.experiment, cameras.watch
    names = view_names(experiment)
    found = cameras.at_once() if at_once else cameras.in_turn()
    if not found.bursts:
        raise found.errors[0]
    burst = together(found.bursts, names)
    if burst.outcome is BurstOutcome.ABORTED and watch.stop() == "discard":
        recorder.discard()
        return TakenBurst(burst, None)
    bursts = {number: judged(experiment, one, cameras.told, number) for number, one in found.bursts.items()}
    together_s = {"at_once": at_once} | ({} if found.apart_s is None else {"apart_s": found.apart_s})
    recorder.keep_views(bursts, names, {**origin, CAMERAS: together_s})
    any_whole = any(one.outcome is BurstOutcome.COMPLETE for one in bursts.values())
    return TakenBurst(together(bursts, names), recorder.folder, found.failed, any_whole)


def take_order(
    camera: Camera,
    experiment: Experiment,
    order: Order,
    watch: BurstWatch = UNWATCHED,
    name: str | None = None,
    opens: OpensView | None = None,
    lamps: Lamps | None = None,
) -> list[TakenBurst]:
    """Take every burst of an order, the first by `name`; fewer when it is stopped. `opens`, `lamps` are as in `take`.

    Raises DeviceSettingError for times that cannot be kept.
    """
    starts_s = evenly(order.bursts, order.every_s)
    rate_hz = camera.info.frame_rate_hz
    check_times(starts_s, order.plan.frames / rate_hz if rate_hz else 0.0)
    taken: list[TakenBurst] = []
    name = name or new_id(experiment.captures_folder, order.plan.role)

    def one(start: BurstStart) -> Burst:
        sequence = None
        if order.bursts > 1:
            sequence = {"id": name} | asdict(start) | {"bursts": order.bursts, "every_s": order.every_s}
        own = name if start.number == 0 else None
        taken.append(
            take(
                camera,
                experiment,
                order.plan,
                order.told,
                watch,
                sequence=sequence,
                name=own,
                at_once=order.at_once,
                opens=opens,
                lamps=lamps,
            )
        )
        if taken[-1].folder is not None and not taken[-1].shortfall:
            watch.kept(taken[-1].folder)
        return taken[-1].burst

    run_sequence(starts_s, one, abort=lambda: watch.stop() is not None, clock=clock_of(camera))
    return taken


def shoot(camera: Camera, where: Path, plan: CapturePlan, watch: BurstWatch = UNWATCHED) -> Burst:
    """Take a burst that becomes no capture. Raises AirlensError without room for it at `where`, DeviceError."""
    check_room(where, plan, camera.info)
    return run_watched(camera, plan, watch, lambda taken: None, None)


def origin_of(experiment: Experiment, plan: CapturePlan) -> dict[str, Any]:
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
