"""Guides the calibration of a service's rig: one thing at a time, in a thread, while the page looks on.

States: idle -> running -> idle | failed. `take` takes the pictures of what is wanted and returns at once.
"""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.guide import GuidedCalibration, LivePlan
from app.calibrate.pictures import StoppedError
from app.errors import AirlensError, BadInputError
from app.experiment.folder import Experiment
from app.rig.conditions import Conditions, conditions_of
from app.rig.live_camera import LiveCamera
from app.rig.open import open_camera, open_stage, panel_of
from app.rig.stage import RealStage, Stage, Task, UnopenedStage
from drivers.display import PatternDisplay
from drivers.errors import DeviceBusyError, DeviceError


class GuideState(StrEnum):
    """Shown to the operator by the same word."""

    idle = "idle"
    running = "running"
    failed = "failed"


@dataclass(frozen=True)
class GuideStatus:
    """What is being taken, or was last: `done` of `total` pictures; `issues` of the newest ones."""

    state: GuideState = GuideState.idle
    experiment: str | None = None
    step: StepName | None = None
    wanted: Task | None = None
    done: int = 0
    total: int = 0
    issues: tuple[str, ...] = ()
    reason: str = ""


class CalibrationDesk:
    """Uses the camera of `live` and the operator's page as `screen`; `tell(kind, body)` hears of progress."""

    def __init__(
        self, live: LiveCamera, screen: PatternDisplay, tell: Callable[[str, Mapping[str, Any]], object]
    ) -> None:
        self._live, self._screen, self._tell = live, screen, tell
        self._status = GuideStatus()
        self._skipped: dict[tuple[str, StepName], tuple[Task, ...]] = {}
        self._lock = threading.Lock()
        self._abort = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def status(self) -> GuideStatus:
        """The present state."""
        return self._status

    def wanted(self, experiment: Experiment, plan: LivePlan) -> Task | None:
        """What is to be arranged next; asks no device. Raises BadInputError where the step cannot begin."""
        return self._asked(experiment, plan).wanted()

    def take(self, experiment: Experiment, plan: LivePlan, told: Conditions) -> GuideStatus:
        """Begin with what is wanted and return at once. Raises DeviceBusyError, BadInputError."""
        with self._lock:
            self._free()
            task = self.wanted(experiment, plan)
            self._abort.clear()
            name = experiment.folder.name
            self._change(GuideStatus(GuideState.running, name, plan.step, task))
            self._thread = threading.Thread(
                target=self._run, args=(experiment, plan, told), name="calibration", daemon=True
            )
            self._thread.start()
            return self._status

    def skip(self, experiment: Experiment, plan: LivePlan) -> Task | None:
        """Do without what is wanted until the service is started anew; return what is wanted then."""
        with self._lock:
            self._free()
            guided = self._asked(experiment, plan)
            guided.skip()
            self._skipped[experiment.folder.name, plan.step] = guided.skipped
            guided.finish()
        return guided.wanted()

    def retake(self, experiment: Experiment, plan: LivePlan, view: str) -> None:
        """Forget a view. Raises BadInputError when there is none of that name, DeviceBusyError."""
        with self._lock:
            self._free()
            self._asked(experiment, plan).retake(view)
            self._tell("calibration", {"experiment": experiment.folder.name, "state": "retake", "view": view})

    def discard(self, experiment: Experiment, plan: LivePlan) -> None:
        """Forget what a step has taken and not completed. Raises DeviceBusyError."""
        with self._lock:
            self._free()
            name = experiment.folder.name
            CalibrationFolder(experiment.folder).discard(plan.step, plan.camera)
            self._skipped.pop((name, plan.step), None)
            self._change(GuideStatus())
            self._tell("calibration", {"experiment": name, "state": "discard", "step": plan.step.value})

    def stop(self) -> GuideStatus:
        """End what runs within a frame; what was taken is kept."""
        self._abort.set()
        if self._thread is not None:
            self._thread.join(timeout=10)
        return self._status

    def close(self) -> None:
        """Stop."""
        self.stop()

    def _free(self) -> None:
        if self._status.state is GuideState.running:
            raise DeviceBusyError("A calibration is taking pictures. Wait for its end, or stop it.")

    def _asked(self, experiment: Experiment, plan: LivePlan) -> GuidedCalibration:
        """The guide without a device."""
        panel = panel_of(experiment.settings.scene)
        stage = UnopenedStage(None if panel is None else self._screen, panel)
        return self._guided(experiment, plan, stage)

    def _guided(self, experiment: Experiment, plan: LivePlan, stage: Stage) -> GuidedCalibration:
        skipped = self._skipped.get((experiment.folder.name, plan.step), ())
        return GuidedCalibration(CalibrationFolder(experiment.folder), plan, stage, skipped)

    def _run(self, experiment: Experiment, plan: LivePlan, told: Conditions) -> None:
        try:
            issues = self._take(experiment, plan, told)
        except StoppedError as stop:
            self._change(replace(self._status, state=GuideState.idle, reason=str(stop)))
        except (AirlensError, BadInputError, DeviceError, OSError) as error:
            self._change(replace(self._status, state=GuideState.failed, reason=str(error)))
        else:
            self._change(replace(self._status, state=GuideState.idle, issues=issues, reason=""))

    def _take(self, experiment: Experiment, plan: LivePlan, told: Conditions) -> tuple[str, ...]:
        with self._stage(experiment, plan) as stage:
            guided = self._guided(experiment, plan, stage)
            guided.resume()
            issues = guided.take(self._progress, self._abort.is_set)
            in_use = guided.finish()
        if in_use:
            CalibrationFolder(experiment.folder).note(conditions_of(experiment.settings, told))
        return issues

    @contextmanager
    def _stage(self, experiment: Experiment, plan: LivePlan) -> Iterator[Stage]:
        """The rig, its camera also shown to whoever looks."""
        name = experiment.folder.name
        if experiment.settings.rig.camera_kind == "simulated":
            stage = open_stage(experiment, plan.board)
            self._live.open(name, lambda: stage.camera, "practice")
            with self._live.using():
                yield stage
            return
        if self._live.status.experiment != name or self._live.status.state.value != "ready":
            self._live.open(name, lambda: open_camera(experiment, "still"))
        panel = panel_of(experiment.settings.scene)
        with self._live.using() as camera:
            yield RealStage(camera, None if panel is None else self._screen, panel)

    def _progress(self, done: int, total: int) -> None:
        self._change(replace(self._status, done=done, total=total))

    def _change(self, status: GuideStatus) -> None:
        told = (self._status.state, self._status.done // 10) != (status.state, status.done // 10)
        self._status = status
        if told:
            names = ("experiment", "done", "total", "reason")
            body = {"state": status.state.value, "step": status.step and status.step.value}
            self._tell("calibration", body | {name: getattr(status, name) for name in names})
