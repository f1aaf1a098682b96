"""Takes captures for somebody who watches: one at a time, in a thread, while the live picture stays alive.

States: idle -> running -> finished | aborted | incomplete | failed. Abort acts within a frame; then what was
taken is kept or discarded, as asked.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from app.capture.checks import judged, noted
from app.errors import AirlensError
from app.experiment.captures import CaptureRecorder
from app.experiment.folder import Experiment, new_id
from app.files.disk_space import check_room
from app.rig.conditions import UNTOLD, seconds_on
from app.rig.live_camera import LiveCamera
from app.rig.open import AirState, open_camera
from drivers.burst import BurstOutcome, CapturePlan, Progress
from drivers.capture import Taken, run_capture
from drivers.errors import DeviceBusyError, DeviceError
from drivers.protocols import Camera

TOLD_EVERY_S = 1.0


class DeskState(StrEnum):
    """Shown to the operator by the same word."""

    idle = "idle"
    running = "running"
    finished = "finished"
    aborted = "aborted"
    incomplete = "incomplete"
    failed = "failed"


OUTCOMES = {
    BurstOutcome.COMPLETE: DeskState.finished,
    BurstOutcome.ABORTED: DeskState.aborted,
    BurstOutcome.DEVICE_LOST: DeskState.incomplete,
    BurstOutcome.TOO_MANY_REFUSED: DeskState.incomplete,
}


@dataclass(frozen=True)
class DeskStatus:
    """The capture that runs, or the last one."""

    state: DeskState = DeskState.idle
    experiment: str | None = None
    capture: str | None = None
    role: str | None = None
    done: int = 0
    total: int = 0
    refused: int = 0
    level: float = 0.0
    reason: str = ""


class CaptureDesk:
    """Takes captures with the camera of `live`; `tell(kind, body)` hears of state and progress."""

    def __init__(self, live: LiveCamera, tell: Callable[[str, Mapping[str, Any]], object]) -> None:
        self._live = live
        self._tell = tell
        self._status = DeskStatus()
        self._abort = threading.Event()
        self._discard = False
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._told_s = 0.0

    @property
    def status(self) -> DeskStatus:
        """The present state."""
        return self._status

    def start(self, experiment: Experiment, plan: CapturePlan) -> DeskStatus:
        """Begin a capture and return at once. Raises DeviceBusyError while another one runs."""
        with self._lock:
            if self._status.state is DeskState.running:
                raise DeviceBusyError("A capture is running. Wait for its end, or abort it.")
            self._abort.clear()
            self._discard = False
            name = new_id(experiment.captures_folder, plan.kind)
            status = DeskStatus(DeskState.running, experiment.folder.name, name, plan.kind, total=plan.frames)
            self._change(status)
            self._thread = threading.Thread(
                target=self._run, args=(experiment, plan, name), name="capture", daemon=True
            )
            self._thread.start()
            return status

    def abort(self, discard: bool) -> DeskStatus:
        """End the running capture within a frame; `discard` removes what was taken."""
        self._discard = discard
        self._abort.set()
        if self._thread is not None:
            self._thread.join(timeout=10)
        return self._status

    def close(self) -> None:
        """Abort and keep."""
        self.abort(discard=False)

    def _run(self, experiment: Experiment, plan: CapturePlan, name: str) -> None:
        try:
            self._connect(experiment, "moving" if plan.kind == "flow" else "still")
            with self._live.using() as camera:
                check_room(experiment.folder, plan, camera.info)
                state, reason = self._take(camera, experiment, name, plan)
        except (AirlensError, DeviceError, OSError) as error:
            self._change(replace(self._status, state=DeskState.failed, reason=str(error)))
            return
        self._change(replace(self._status, state=state, reason=reason))

    def _connect(self, experiment: Experiment, air: AirState) -> None:
        """Open the rig's camera unless it is; a simulated room is told what its air does."""
        source = experiment.folder.name
        open_for = (self._live.status.experiment, self._live.air)
        simulated = experiment.settings.rig.camera_kind == "simulated"
        if self._live.status.state.value != "ready" or open_for != (
            source,
            air if simulated else self._live.air,
        ):
            self._live.open(source, lambda: open_camera(experiment, air), air)

    def _take(
        self, camera: Camera, experiment: Experiment, name: str, plan: CapturePlan
    ) -> tuple[DeskState, str]:
        recorder = CaptureRecorder(experiment.captures_folder / name, plan)

        def follow(taken: Taken) -> None:
            recorder.observe(taken)
            self._live.show(taken.frame)

        try:
            burst = run_capture(
                camera,
                plan,
                self._progress,
                on_frame=follow,
                abort=self._abort.is_set,
                rig_on_s=seconds_on(experiment.settings, UNTOLD),
            )
        except BaseException:
            recorder.discard()
            raise
        if self._abort.is_set() and self._discard:
            recorder.discard()
            return DeskState.aborted, "Discarded, as asked."
        recorder.keep(judged(experiment, burst), origin={"taken_by": "service"} | noted(experiment, UNTOLD))
        if burst.outcome is BurstOutcome.COMPLETE:
            return DeskState.finished, ""
        kept = f"{burst.frames} of {plan.frames} frames are kept as an incomplete capture."
        return OUTCOMES[
            burst.outcome
        ], f"The burst ended early ({burst.outcome.value}); {kept} Take it again."

    def _progress(self, progress: Progress) -> None:
        status = replace(
            self._status,
            done=progress.done,
            total=progress.total,
            refused=progress.refused,
            level=progress.level,
        )
        if time.monotonic() - self._told_s > TOLD_EVERY_S:
            self._change(status)
        else:
            self._status = status

    def _change(self, status: DeskStatus) -> None:
        self._status = status
        self._told_s = time.monotonic()
        names = ("experiment", "capture", "role", "done", "total", "reason")
        self._tell("capture", {"state": status.state.value} | {name: getattr(status, name) for name in names})
