"""Guides the calibration of a service's rig: one thing at a time, in a thread, while the page looks on.

`GUIDE` is the table of its states. `take` takes the pictures of what is wanted and returns at once.
"""

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from typing import Any

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.guide import GuidedCalibration, LivePlan
from app.calibrate.pictures import CalibrationStoppedError
from app.errors import AirlensError
from app.experiment.folder import Experiment
from app.experiment.views import lamp_number, opened_for, view_number
from app.rig.conditions import Conditions, conditions_of
from app.rig.lamps import lamps_beside
from app.rig.live_cameras import LiveCameras
from app.rig.live_projectors import LiveProjectors
from app.rig.open import open_camera, open_stage, panel_of
from app.rig.stage import RealStage, Stage, StageTask, UnopenedStage
from app.states import StateMachine
from calibration.board import Board
from drivers.display import PatternDisplay
from drivers.errors import DeviceBusyError, DeviceError

STOP_LIMIT_S = 30.0
_log = logging.getLogger(__name__)


class GuideState(StrEnum):
    """Shown to the operator by the same word."""

    idle = "idle"
    running = "running"
    failed = "failed"


class GuideEvent(StrEnum):
    """What happens to the guide: `take` and `discard` are asked for."""

    take = "take pictures"
    discard = "discard"
    end = "end"
    fail = "fail"


GUIDE = StateMachine(
    name="A calibration",
    table={
        GuideState.idle: {GuideEvent.take: GuideState.running, GuideEvent.discard: GuideState.idle},
        GuideState.failed: {GuideEvent.take: GuideState.running, GuideEvent.discard: GuideState.idle},
        GuideState.running: {GuideEvent.end: GuideState.idle, GuideEvent.fail: GuideState.failed},
    },
    asked=frozenset({GuideEvent.take, GuideEvent.discard}),
    error=DeviceBusyError,
)


@dataclass(eq=False)
class Taking:
    """Pictures that are being taken."""

    abort: threading.Event = field(default_factory=threading.Event)
    thread: threading.Thread | None = None


# Takes pictures until it is told to stop, and returns what is wrong with them.
Work = Callable[[Taking], tuple[str, ...]]


@dataclass(frozen=True)
class GuideStatus:
    """What is being taken, or was last: `done` of `total` pictures; `issues` of the newest ones.

    Without a `step` it is a board before several cameras.
    """

    state: GuideState = GuideState.idle
    experiment: str | None = None
    step: StepName | None = None
    camera: str | None = None
    wanted: StageTask | None = None
    done: int = 0
    total: int = 0
    issues: tuple[str, ...] = ()
    reason: str = ""


class CalibrationDesk:
    """Uses the cameras of `live`; `screen_of(view)` is the kiosk of the projector that lights a view.

    `tell(kind, body)` hears of progress.

    Of several projectors before one camera all are dark but the one that is calibrated; `projectors` are those
    that the service speaks to already.
    """

    def __init__(
        self,
        live: LiveCameras,
        screen_of: Callable[[int], PatternDisplay],
        tell: Callable[[str, Mapping[str, Any]], object],
        projectors: LiveProjectors | None = None,
    ) -> None:
        self._live, self._screen_of, self._tell = live, screen_of, tell
        self._projectors = projectors
        self._status = GuideStatus()
        self._skipped: dict[tuple[str, StepName, str], tuple[StageTask, ...]] = {}
        self._lock = threading.Lock()
        self._now: Taking | None = None

    @property
    def status(self) -> GuideStatus:
        """The present state."""
        return self._status

    def wanted(self, experiment: Experiment, plan: LivePlan) -> StageTask | None:
        """What is to be arranged next; asks no device. Raises BadInputError where the step cannot begin."""
        return self._asked(experiment, plan).wanted()

    def take(self, experiment: Experiment, plan: LivePlan, told: Conditions) -> GuideStatus:
        """Begin with what is wanted and return at once. Raises DeviceBusyError, BadInputError."""
        with self._lock:
            self.free()
            begun = GuideStatus(
                experiment=experiment.folder.name,
                step=plan.step,
                camera=plan.camera,
                wanted=self.wanted(experiment, plan),
            )
            self._begin(begun, lambda run: self._take(run, experiment, plan, told))
        self._tell_status()
        return self._status

    def run(self, begun: GuideStatus, work: Work) -> GuideStatus:
        """Begin with other pictures, of which `work` returns what is wrong with them. Raises DeviceBusyError."""
        with self._lock:
            self._begin(begun, work)
        self._tell_status()
        return self._status

    def _begin(self, begun: GuideStatus, work: Work) -> None:
        state = GUIDE.after(self._status.state, GuideEvent.take)
        run = Taking()
        run.thread = threading.Thread(target=self._run, args=(run, work), name="calibration", daemon=True)
        self._now = run
        before, self._status = self._status, replace(begun, state=state)
        try:
            run.thread.start()
        except RuntimeError:  # no more threads
            self._now, self._status = None, before
            raise

    def skip(self, experiment: Experiment, plan: LivePlan) -> StageTask | None:
        """Do without what is wanted until the service is started anew; return what is wanted then."""
        with self._lock:
            self.free()
            guided = self._asked(experiment, plan)
            guided.skip()
            self._skipped[experiment.folder.name, plan.step, plan.camera] = guided.skipped
            guided.finish()
        return guided.wanted()

    def retake(self, experiment: Experiment, plan: LivePlan, view: str) -> None:
        """Forget a view. Raises BadInputError when there is none of that name, DeviceBusyError."""
        with self._lock:
            self.free()
            self._asked(experiment, plan).retake(view)
            self._tell("calibration", {"experiment": experiment.folder.name, "state": "retake", "view": view})

    def discard(self, experiment: Experiment, plan: LivePlan) -> None:
        """Forget what a step has taken and not completed. Raises DeviceBusyError."""
        with self._lock:
            self.free()
            name = experiment.folder.name
            CalibrationFolder(experiment.folder).discard(plan.step, plan.camera)
            self._skipped.pop((name, plan.step, plan.camera), None)
            self._status = GuideStatus(GUIDE.after(self._status.state, GuideEvent.discard))
            self._tell("calibration", {"experiment": name, "state": "discard", "step": plan.step.value})

    def stop(self) -> GuideStatus:
        """End what runs within a frame; what was taken is kept."""
        with self._lock:
            run = self._now
        if run is None or run.thread is None:
            return self._status
        run.abort.set()
        run.thread.join(timeout=STOP_LIMIT_S)
        if self._now is run:
            reason = f"The camera did not end its picture within {STOP_LIMIT_S:g} s. Connect it again."
            self._live.give_up(reason)
            self._end(run, GuideEvent.fail, reason=reason)
        return self._status

    def close(self) -> None:
        """Stop."""
        self.stop()

    def free(self) -> None:
        """Refuse while pictures are taken. Raises DeviceBusyError."""
        GUIDE.after(self._status.state, GuideEvent.take)

    def _asked(self, experiment: Experiment, plan: LivePlan) -> GuidedCalibration:
        """The guide without a device."""
        display, panel = self._thrown(experiment, view_number(experiment, plan.camera))
        stage = UnopenedStage(display, panel)
        return self._guided(experiment, plan, stage)

    def _guided(self, experiment: Experiment, plan: LivePlan, stage: Stage) -> GuidedCalibration:
        skipped = self._skipped.get((experiment.folder.name, plan.step, plan.camera), ())
        return GuidedCalibration(CalibrationFolder(experiment.folder), plan, stage, skipped)

    def _run(self, run: "Taking", work: Work) -> None:
        try:
            issues = work(run)
        except CalibrationStoppedError as stop:
            self._end(run, GuideEvent.end, reason=str(stop))
        except (AirlensError, DeviceError, OSError) as error:
            self._end(run, GuideEvent.fail, reason=str(error))
        except Exception as error:
            _log.exception("calibration of %s", self._status.experiment)
            self._end(run, GuideEvent.fail, reason=f"{type(error).__name__}: {error}. This is a defect.")
        else:
            self._end(run, GuideEvent.end, issues=issues)

    def _take(
        self, run: "Taking", experiment: Experiment, plan: LivePlan, told: Conditions
    ) -> tuple[str, ...]:
        with self._stage(experiment, plan) as stage:
            guided = self._guided(experiment, plan, stage)
            guided.resume()
            issues = guided.take(partial(self._progress, run), run.abort.is_set)
            in_use = guided.finish()
        if in_use:
            CalibrationFolder(experiment.folder).note(conditions_of(experiment.settings, told))
        return issues

    @contextmanager
    def _stage(self, experiment: Experiment, plan: LivePlan) -> Iterator[Stage]:
        """The rig, its camera also shown to whoever looks."""
        view = view_number(experiment, plan.camera)
        display, panel = self._thrown(experiment, view)
        if display is not None:
            lamps_beside(experiment, self._projectors).light(view)
        with shown_stage(self._live, experiment, plan.board, view) as stage:
            if not isinstance(stage, RealStage):
                yield stage
                return
            yield replace(stage, display=display, panel_px=panel)

    def _thrown(
        self, experiment: Experiment, view: int
    ) -> tuple[PatternDisplay | None, tuple[int, int] | None]:
        """The screen of the projector that lights a view, with its size; none of a print."""
        panel = panel_of(experiment.settings.scene, view)
        return (None if panel is None else self._screen_of(lamp_number(experiment, view))), panel

    def _progress(self, run: "Taking", done: int, total: int) -> None:
        with self._lock:
            if self._now is not run:
                return
            told = self._status.done // 10 != done // 10
            self._status = replace(self._status, done=done, total=total)
        if told:
            self._tell_status()

    def _end(
        self, run: "Taking", event: GuideEvent, *, issues: tuple[str, ...] | None = None, reason: str = ""
    ) -> None:
        """Leave the running state, once."""
        with self._lock:
            if self._now is not run:
                return
            self._now = None
            state = GUIDE.after(self._status.state, event)
            kept = self._status.issues if issues is None else issues
            self._status = replace(self._status, state=state, issues=kept, reason=reason)
        self._tell_status()

    def _tell_status(self) -> None:
        status = self._status
        names = ("experiment", "done", "total", "reason")
        body = {"state": status.state.value, "step": status.step and status.step.value}
        self._tell("calibration", body | {name: getattr(status, name) for name in names})


@contextmanager
def shown_stage(live: LiveCameras, experiment: Experiment, board: Board | None, view: int) -> Iterator[Stage]:
    """The rig of a view, its camera also shown to whoever looks. Raises BadInputError, DeviceError."""
    name, eye = experiment.folder.name, opened_for(experiment, view)
    seen = live.of(eye)
    if experiment.settings.rig.camera_kind == "simulated":
        stage = open_stage(experiment, board, view=view)
        live.open(name, view, lambda: stage.camera, "practice")
        with seen.using():
            yield stage
        return
    if seen.status.experiment != name or seen.status.state.value != "ready":
        live.open(name, eye, lambda: open_camera(experiment, "still", view))
    with seen.using() as camera:
        yield RealStage(camera)
