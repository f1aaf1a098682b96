"""Takes captures for somebody who watches: one at a time, in a thread, while the live picture stays alive.

`CAPTURE` is the table of its states: running ends as finished, aborted, incomplete or failed, and from each of
these the next capture may start. Abort acts within a frame; then what was taken is kept or discarded, as asked.
A capture is on record (its folder) before it is said to run: so a kill leaves it in the list as interrupted.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from app.capture.burst import Order, TakenBurst, take_order
from app.capture.retake import name_of_retake, place_of, retake, to_retake
from app.capture.views import OpensView
from app.capture.watched import BurstWatch, OnAbort
from app.errors import AirlensError
from app.experiment.folder import Experiment, new_id
from app.experiment.recorder import release, reserve
from app.experiment.views import opened_for
from app.live.beside import LiveAir
from app.rig.conditions import Conditions
from app.rig.lamps import lamps_beside
from app.rig.live_cameras import LiveCameras
from app.rig.live_projectors import LiveProjectors
from app.rig.open import AirState, air_of, open_camera
from app.states import StateMachine
from drivers.burst import BurstOutcome, CapturePlan, Progress
from drivers.errors import DeviceBusyError, DeviceError
from drivers.protocols import Camera

TOLD_EVERY_S = 1.0
ABORT_LIMIT_S = 30.0
_log = logging.getLogger(__name__)


class DeskState(StrEnum):
    """Shown to the operator by the same word."""

    idle = "idle"
    running = "running"
    finished = "finished"
    aborted = "aborted"
    incomplete = "incomplete"
    failed = "failed"


class CaptureEvent(StrEnum):
    """What happens to the desk: `start` and `abort` are asked for."""

    start = "start"
    complete = "complete"
    abort = "abort"
    cut_short = "cut short"
    fail = "fail"


_S, _E = DeskState, CaptureEvent
CAPTURE = StateMachine(
    name="A capture",
    table={
        _S.running: {
            _E.complete: _S.finished,
            _E.abort: _S.aborted,
            _E.cut_short: _S.incomplete,
            _E.fail: _S.failed,
        },
        **{state: {_E.start: _S.running} for state in DeskState if state is not _S.running},
    },
    asked=frozenset({_E.start, _E.abort}),
    error=DeviceBusyError,
)
OUTCOMES = {
    BurstOutcome.COMPLETE: _E.complete,
    BurstOutcome.ABORTED: _E.abort,
    BurstOutcome.DEVICE_LOST: _E.cut_short,
    BurstOutcome.TOO_MANY_REFUSED: _E.cut_short,
}


@dataclass(frozen=True)
class DeskStatus:
    """The capture that runs, or the last one: `done` of `total` frames, and which of `bursts` it is."""

    state: DeskState = DeskState.idle
    experiment: str | None = None
    capture: str | None = None
    role: str | None = None
    total: int = 0
    bursts: int = 1
    burst: int = 1
    done: int = 0
    refused: int = 0
    level: float = 0.0
    reason: str = ""


@dataclass(eq=False)
class _Run:
    """One order that is carried out; `stop` says what becomes of the frames once it is to end.

    `takes` takes it with the camera of `view`, whose simulated mount stands at `moment`, and with those of further
    views, and says how it ended.
    """

    experiment: Experiment
    plan: CapturePlan
    name: str
    takes: Callable[[Camera, BurstWatch, OpensView], tuple[CaptureEvent, str]]
    view: int = 0
    moment: int | None = None
    live: bool = False
    stop: OnAbort | None = None
    thread: threading.Thread | None = None


class CaptureDesk:
    """Takes captures with the cameras of `live`; `tell(kind, body)` hears of state and progress, and never raises.

    `opener` opens the camera of an experiment's view. `beside` looks at the bursts of orders that ask for it.
    `projectors` are those that the service speaks to already.
    """

    def __init__(
        self,
        live: LiveCameras,
        tell: Callable[[str, Mapping[str, Any]], object],
        opener: Callable[[Experiment, AirState, int, int | None], Camera] = open_camera,
        beside: LiveAir | None = None,
        projectors: LiveProjectors | None = None,
    ) -> None:
        self._live, self._tell, self._opener, self._beside = live, tell, opener, beside
        self._projectors = projectors
        self._status = DeskStatus()
        self._lock = threading.RLock()
        self._now: _Run | None = None
        self._told_s = 0.0

    @property
    def status(self) -> DeskStatus:
        """The present state."""
        return self._status

    def start(self, experiment: Experiment, order: Order) -> DeskStatus:
        """Begin a capture and return at once; its folder is then on the disk, as an interrupted capture's.

        Raises DeviceBusyError while another one runs, OSError when the disk takes no folder.
        """
        with self._lock:
            state = CAPTURE.after(self._status.state, CaptureEvent.start)
            plan = order.plan
            name = new_id(experiment.captures_folder, plan.role)
            reserve(experiment.captures_folder / name, plan)

            def takes(camera: Camera, watch: BurstWatch, opens: OpensView) -> tuple[CaptureEvent, str]:
                return _ending(
                    order,
                    take_order(
                        camera,
                        experiment,
                        order,
                        watch,
                        name,
                        opens,
                        lamps_beside(experiment, self._projectors),
                    ),
                )

            return self._begin(state, _Run(experiment, plan, name, takes, live=order.live), order.bursts)

    def retake(self, experiment: Experiment, capture: str, view: str | None, told: Conditions) -> DeskStatus:
        """Take one camera's picture of a capture again, alone, and return at once.

        Raises BadInputError for a view that cannot be taken alone, DeviceBusyError while a capture runs.
        """
        with self._lock:
            state = CAPTURE.after(self._status.state, CaptureEvent.start)
            parts, number = to_retake(experiment, capture, view)
            plan, name = parts.plan, name_of_retake(experiment, parts)
            if name != capture:
                reserve(experiment.captures_folder / name, plan)

            def takes(camera: Camera, watch: BurstWatch, opens: OpensView) -> tuple[CaptureEvent, str]:
                lamps = lamps_beside(experiment, self._projectors)
                taken = retake(camera, experiment, parts, number, told, watch, name, lamps)
                return _ending(Order(plan), [taken])

            return self._begin(state, _Run(experiment, plan, name, takes, number, place_of(parts.origin)), 1)

    def _begin(self, state: DeskState, run: _Run, bursts: int) -> DeskStatus:
        """Let a run go on by itself; the desk is locked meanwhile."""
        run.thread = threading.Thread(target=self._run, args=(run,), name="capture", daemon=True)
        self._now = run
        status = DeskStatus(
            state, run.experiment.folder.name, run.name, run.plan.role, run.plan.frames, bursts
        )
        self._status = status
        try:
            run.thread.start()
        except RuntimeError as error:  # no more threads
            release(run.experiment.captures_folder / run.name)
            self._end(run, CaptureEvent.fail, f"{error}. Close other programs, then take it again.")
            return self._status
        self._tell_status()
        return status

    def abort(self, discard: bool) -> DeskStatus:
        """End the running capture within a frame; `discard` removes what was taken.

        One that does not end in time is left behind, with its camera: the next one can begin.
        """
        with self._lock:
            run = self._now
        if run is None or run.thread is None:
            return self._status
        run.stop = "discard" if discard else "keep"
        run.thread.join(timeout=ABORT_LIMIT_S)
        if self._now is run:
            reason = f"The camera did not end the capture within {ABORT_LIMIT_S:g} s. Connect it again."
            self._live.give_up(reason)
            self._end(run, CaptureEvent.abort, f"{reason} Frames that were kept are in {run.name}.")
        return self._status

    def wait(self, limit_s: float) -> DeskStatus:
        """Wait until the running capture has ended, at most so long."""
        with self._lock:
            run = self._now
        if run is not None and run.thread is not None:
            run.thread.join(timeout=limit_s)
        return self._status

    def close(self) -> None:
        """Abort and keep."""
        self.abort(discard=False)

    def _run(self, run: _Run) -> None:
        try:
            event, reason = self._take(run)
        except (AirlensError, DeviceError, OSError) as error:
            event, reason = CaptureEvent.fail, str(error)
        except Exception as error:
            _log.exception("capture %s", run.name)
            event, reason = CaptureEvent.fail, f"{type(error).__name__}: {error}. This is a defect."
        release(run.experiment.captures_folder / run.name)
        self._end(run, event, reason)

    def _take(self, run: _Run) -> tuple[CaptureEvent, str]:
        watch = BurstWatch(
            self._following(run, self._progress),
            lambda taken, view: self._live.of(opened_for(run.experiment, run.view or view)).show(taken.frame),
            lambda: run.stop,
            self._following(run, self._begun),
            lambda folder: self._look(run, folder),
        )
        if self._beside is not None and run.live and run.plan.role == "flow":
            self._beside.prepare(run.experiment.folder)
        with self._using(run, run.view) as camera:
            return run.takes(camera, watch, lambda view: self._using(run, view))

    def _look(self, run: _Run, folder: Path) -> None:
        """Let T of a burst be looked at; after a reference, what its bursts will be compared with is made ready."""
        if self._beside is None or not run.live:
            return
        if run.plan.role == "flow":
            self._beside.look(run.experiment.folder, folder, run.name)
        elif run.plan.role == "reference":
            self._beside.prepare(run.experiment.folder)

    def _following(self, run: _Run, act: Callable[[Any], object]) -> Callable[[Any], object]:
        """Let a run that was left behind tell nothing more."""

        def follow(told: Any) -> None:
            with self._lock:
                if self._now is run:
                    act(told)

        return follow

    def _end(self, run: _Run, event: CaptureEvent, reason: str) -> None:
        """Leave the running state, once."""
        with self._lock:
            if self._now is not run:
                return
            self._now = None
            state = CAPTURE.after(self._status.state, event)
            self._status = replace(self._status, state=state, reason=reason)
        self._tell_status()

    @contextmanager
    def _using(self, run: _Run, view: int) -> Iterator[Camera]:
        """Hold the camera of a view, opened unless it is; a simulated room is told what its air does."""
        simulated = run.experiment.settings.rig.camera_kind == "simulated"
        view = opened_for(run.experiment, view)
        source, air, live = run.experiment.folder.name, air_of(run.plan.role), self._live.of(view)
        wanted = (source, air if simulated else live.air)
        again = live.status.state.value != "ready" or (live.status.experiment, live.air) != wanted
        if again or (simulated and run.moment is not None):
            self._live.open(source, view, lambda: self._opener(run.experiment, air, view, run.moment), air)
        with live.using() as camera:
            yield camera

    def _begun(self, folder: Path) -> None:
        now = self._status
        burst = now.burst + (folder.name != now.capture)
        self._change(replace(now, capture=folder.name, burst=burst, done=0, refused=0))

    def _progress(self, progress: Progress) -> None:
        status = replace(
            self._status,
            done=progress.done,
            total=progress.total,
            refused=progress.refused,
            level=progress.level,
        )
        self._change(status, told=time.monotonic() - self._told_s > TOLD_EVERY_S)

    def _change(self, status: DeskStatus, told: bool = True) -> None:
        with self._lock:
            self._status = status
        if told:
            self._tell_status()

    def _tell_status(self) -> None:
        status, self._told_s = self._status, time.monotonic()
        names = ("experiment", "capture", "role", "burst", "bursts", "done", "total", "reason")
        self._tell("capture", {"state": status.state.value} | {name: getattr(status, name) for name in names})


def _ending(order: Order, taken: list[TakenBurst]) -> tuple[CaptureEvent, str]:
    """How an order ended, by its last burst."""
    if not taken:
        return CaptureEvent.abort, "Stopped before the first burst; nothing was taken."
    last = taken[-1]
    if last.failed and last.burst.outcome is not BurstOutcome.ABORTED:
        return CaptureEvent.cut_short, last.shortfall
    if last.shortfall or len(taken) == order.bursts:
        return OUTCOMES[last.burst.outcome], last.shortfall
    return CaptureEvent.abort, f"Stopped after {len(taken)} of {order.bursts} bursts; they are kept."
