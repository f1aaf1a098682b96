"""One projector that a service speaks to: asked every few seconds by a thread, and every change is told.

States: closed; then the projector's own words (standby, warming, on, cooling, fault, silent); lost when the
line itself is gone. It is asked on in every one of them: what comes back is found without a click.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from drivers.errors import DeviceError, DeviceNotFoundError
from drivers.projector.protocol import Projector, ProjectorStatus
from drivers.projector.wire_log import WireEntry


class ProjectorState(StrEnum):
    """Shown to the operator by the same word."""

    closed = "closed"
    standby = "standby"
    warming = "warming"
    on = "on"
    cooling = "cooling"
    fault = "fault"
    silent = "silent"
    lost = "lost"


SWITCHING = (ProjectorState.warming, ProjectorState.cooling)
REASONS = {
    ProjectorState.silent: "The projector does not answer. Check its power and its cable; it is asked on.",
    ProjectorState.fault: "The projector reports a fault. Look at its indicators and at its errors.",
}


@dataclass(frozen=True)
class ProjectorReport:
    """What is known: `said` by the projector itself; `since_s` (Unix time) is when the state began.

    `view` is the number of the first view that sees by it.
    """

    state: ProjectorState = ProjectorState.closed
    source: str | None = None
    said: ProjectorStatus | None = None
    capabilities: tuple[str, ...] = ()
    since_s: float = 0.0
    reason: str = ""
    view: int = 0


class LiveProjector:
    """One projector of a service, that of `view`. `tell(kind, body)` hears of every change of state."""

    def __init__(
        self,
        tell: Callable[[str, Mapping[str, Any]], object],
        idle_s: float = 5.0,
        switching_s: float = 1.0,
        view: int = 0,
    ) -> None:
        self._tell = tell
        self._idle_s, self._switching_s = idle_s, switching_s
        self._projector: Projector | None = None
        self._report = ProjectorReport(view=view)
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._lock = threading.Lock()

    @property
    def report(self) -> ProjectorReport:
        """What is known now."""
        return self._report

    @property
    def wire(self) -> tuple[WireEntry, ...]:
        """The latest traffic, oldest first."""
        return () if self._projector is None else self._projector.log.entries

    def open(self, source: str, make: Callable[[], Projector]) -> ProjectorReport:
        """Speak to the projector that `make` returns, in place of any other. Raises DeviceError."""
        self.close()
        self._projector, self._stop = make(), threading.Event()
        self._ask(self._projector, source)
        self._thread = threading.Thread(
            target=self._run, args=(self._projector, source, self._stop), name="projector", daemon=True
        )
        self._thread.start()
        return self._report

    def close(self) -> ProjectorReport:
        """Free the line; the lamp stays as it is."""
        self._stop.set()
        projector, self._projector = self._projector, None
        if self._thread is not None:
            self._thread.join(timeout=15)
            self._thread = None
        if projector is not None:
            projector.close()
            self._change(ProjectorReport())
        return self._report

    def command(self, act: Callable[[Projector], object]) -> ProjectorReport:
        """Let `act` ask something of the projector, then ask how it is. Raises DeviceError."""
        projector, source = self._projector, self._report.source
        if projector is None or source is None:
            raise DeviceNotFoundError("No projector is connected. Connect the one of an experiment's rig.")
        act(projector)
        self._ask(projector, source)
        return self._report

    def held(self, source: str) -> Projector | None:
        """The projector itself, where it is that of this experiment: its line is this one's."""
        return self._projector if self._report.source == source else None

    def _run(self, projector: Projector, source: str, stop: threading.Event) -> None:
        while not stop.wait(self._switching_s if self._report.state in SWITCHING else self._idle_s):
            self._ask(projector, source)

    def _ask(self, projector: Projector, source: str) -> None:
        with self._lock:
            try:
                said = projector.status()
            except DeviceError as error:
                self._change(ProjectorReport(ProjectorState.lost, source, reason=str(error)))
                return
            if self._projector is not projector:
                return
            known = tuple(sorted(str(one) for one in projector.capabilities))
            state = ProjectorState(said.power.value)
            self._change(ProjectorReport(state, source, said, known, reason=REASONS.get(state, "")))

    def _change(self, new: ProjectorReport) -> None:
        before = self._report
        changed = new.state != before.state
        since_s = time.time() if changed else before.since_s
        self._report = replace(new, since_s=since_s, view=before.view)
        if changed or new.reason != before.reason:
            body = {
                "device": "projector",
                "view": before.view,
                "state": new.state.value,
                "reason": new.reason,
            }
            self._tell("device", body)
