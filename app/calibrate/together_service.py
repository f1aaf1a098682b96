"""Boards before several cameras of a service's rig: one place at a time, with pictures by all cameras at once.

The pictures are taken by the calibration's desk, so that no other step is taken meanwhile.
"""

import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

from app.calibrate.folder import CalibrationFolder
from app.calibrate.service import CalibrationDesk, GuideState, GuideStatus, Taking, shown_stage
from app.calibrate.together import records_of
from app.calibrate.together_live import TogetherPlan, TogetherSession
from app.experiment.folder import Experiment
from app.experiment.views import own_cameras, view_names
from app.rig.live_cameras import LiveCameras
from app.rig.stage import StageTask, UnopenedStage
from calibration.record import SeenBoard


@dataclass(frozen=True)
class TogetherStatus:
    """What is wanted next; `now` is what is being taken, or was last; `newest` what was found then, by camera."""

    now: GuideStatus
    wanted: StageTask | None
    newest: Mapping[str, SeenBoard]


class TogetherDesk:
    """Uses the cameras of `live` and the thread of `desk`; `tell(kind, body)` hears of what is forgotten."""

    def __init__(
        self,
        live: LiveCameras,
        desk: CalibrationDesk,
        tell: Callable[[str, Mapping[str, Any]], object],
    ) -> None:
        self._live, self._desk, self._tell = live, desk, tell
        self._lock = threading.Lock()
        self._skipped: dict[str, int] = {}
        self._newest: dict[str, dict[str, SeenBoard]] = {}
        self._resumed: set[str] = set()

    def status(self, experiment: Experiment, plan: TogetherPlan) -> TogetherStatus:
        """How far it is; asks no device. Raises BadInputError where it cannot begin."""
        name, now = experiment.folder.name, self._desk.status
        if now.experiment != name or now.step is not None:
            now = GuideStatus(now.state if now.state is GuideState.running else GuideState.idle)
        return TogetherStatus(now, self._unopened(experiment, plan).wanted(), self._newest.get(name, {}))

    def take(self, experiment: Experiment, plan: TogetherPlan) -> None:
        """Begin with pictures of the next place and return at once. Raises DeviceBusyError, BadInputError."""
        task = self._unopened(experiment, plan).wanted()
        begun = GuideStatus(experiment=experiment.folder.name, wanted=task, total=1)
        self._desk.run(begun, partial(self._work, experiment, plan))

    def skip(self, experiment: Experiment, plan: TogetherPlan) -> None:
        """Do with one place less until the service is started anew. Raises DeviceBusyError, BadInputError."""
        self._desk.free()
        if self._unopened(experiment, plan).wanted() is not None:
            with self._lock:
                name = experiment.folder.name
                self._skipped[name] = self._skipped.get(name, 0) + 1

    def retake(self, experiment: Experiment, plan: TogetherPlan, place: str) -> None:
        """Forget a place. Raises BadInputError when there is none of that name, DeviceBusyError."""
        self._desk.free()
        self._unopened(experiment, plan).retake(place)
        with self._lock:
            self._newest.pop(experiment.folder.name, None)
        self._tell("calibration", {"experiment": experiment.folder.name, "state": "retake", "view": place})

    def discard(self, experiment: Experiment) -> None:
        """Forget all places; the calibration in use stays. Raises DeviceBusyError."""
        self._desk.free()
        name = experiment.folder.name
        CalibrationFolder(experiment.folder).forget_shared()
        with self._lock:
            self._skipped.pop(name, None)
            self._newest.pop(name, None)
        self._tell("calibration", {"experiment": name, "state": "discard", "step": None})

    def _unopened(self, experiment: Experiment, plan: TogetherPlan) -> TogetherSession:
        """The session without a device."""
        calibration = CalibrationFolder(experiment.folder)
        records_of(calibration)
        stages = {view_names(experiment)[number]: UnopenedStage() for number in own_cameras(experiment)}
        return self._session(calibration, plan, stages)

    def _session(
        self, calibration: CalibrationFolder, plan: TogetherPlan, stages: Mapping[str, Any]
    ) -> TogetherSession:
        return TogetherSession(calibration, plan, stages, self._skipped.get(calibration.experiment.name, 0))

    def _work(self, experiment: Experiment, plan: TogetherPlan, run: Taking) -> tuple[str, ...]:
        name, issues = experiment.folder.name, ()
        with ExitStack() as stack:
            stages = {
                view_names(experiment)[number]: stack.enter_context(
                    shown_stage(self._live, experiment, plan.board, number)
                )
                for number in own_cameras(experiment)
            }
            session = self._session(CalibrationFolder(experiment.folder), plan, stages)
            if name not in self._resumed:
                issues = session.resume()
                self._resumed.add(name)
            if session.wanted() is None:
                return (*issues, "There is no further place that two cameras see whole.")
            issues += session.take(run.abort.is_set)
        with self._lock:
            self._newest[name] = session.newest
        return issues
