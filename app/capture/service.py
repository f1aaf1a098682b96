"""Takes captures for somebody who watches: one at a time, in a thread, while the live picture stays alive.

States: idle -> running -> finished | aborted | incomplete | failed. Abort acts within a frame; then what was
taken is kept or discarded, as asked.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from app.capture.burst import OnAbort, Order, TakenBurst, Watch, take_order
from app.errors import AirlensError
from app.experiment.folder import Experiment, new_id
from app.rig.live_camera import LiveCamera
from app.rig.open import AirState, air_of, open_camera
from drivers.burst import BurstOutcome, Progress
from drivers.errors import DeviceBusyError, DeviceError

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
    """The capture that runs, or the last one: `done` of `total` frames, the how manieth of `bursts`."""

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


class CaptureDesk:
    """Takes captures with the camera of `live`; `tell(kind, body)` hears of state and progress."""

    def __init__(self, live: LiveCamera, tell: Callable[[str, Mapping[str, Any]], object]) -> None:
        self._live = live
        self._tell = tell
        self._status = DeskStatus()
        self._stop: OnAbort | None = None
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._told_s = 0.0

    @property
    def status(self) -> DeskStatus:
        """The present state."""
        return self._status

    def start(self, experiment: Experiment, order: Order) -> DeskStatus:
        """Begin a capture and return at once. Raises DeviceBusyError while another one runs."""
        with self._lock:
            if self._status.state is DeskState.running:
                raise DeviceBusyError("A capture is running. Wait for its end, or abort it.")
            self._stop = None
            plan = order.plan
            name = new_id(experiment.captures_folder, plan.role)
            folder = experiment.folder.name
            status = DeskStatus(DeskState.running, folder, name, plan.role, plan.frames, order.bursts)
            self._change(status)
            self._thread = threading.Thread(
                target=self._run, args=(experiment, order, name), name="capture", daemon=True
            )
            self._thread.start()
            return status

    def abort(self, discard: bool) -> DeskStatus:
        """End the running capture within a frame; `discard` removes what was taken."""
        self._stop = "discard" if discard else "keep"
        if self._thread is not None:
            self._thread.join(timeout=10)
        return self._status

    def close(self) -> None:
        """Abort and keep."""
        self.abort(discard=False)

    def _run(self, experiment: Experiment, order: Order, name: str) -> None:
        watch = Watch(
            self._progress, lambda taken: self._live.show(taken.frame), lambda: self._stop, self._begun
        )
        try:
            self._connect(experiment, air_of(order.plan.role))
            with self._live.using() as camera:
                taken = take_order(camera, experiment, order, watch, name)
        except (AirlensError, DeviceError, OSError) as error:
            self._change(replace(self._status, state=DeskState.failed, reason=str(error)))
            return
        state, reason = _ending(order, taken)
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
        if time.monotonic() - self._told_s > TOLD_EVERY_S:
            self._change(status)
        else:
            self._status = status

    def _change(self, status: DeskStatus) -> None:
        self._status = status
        self._told_s = time.monotonic()
        names = ("experiment", "capture", "role", "burst", "bursts", "done", "total", "reason")
        self._tell("capture", {"state": status.state.value} | {name: getattr(status, name) for name in names})


def _ending(order: Order, taken: list[TakenBurst]) -> tuple[DeskState, str]:
    """How an order ended, by its last burst."""
    if not taken:
        return DeskState.aborted, "Stopped before the first burst; nothing was taken."
    last = taken[-1]
    if last.shortfall or len(taken) == order.bursts:
        return OUTCOMES[last.burst.outcome], last.shortfall
    return DeskState.aborted, f"Stopped after {len(taken)} of {order.bursts} bursts; they are kept."
