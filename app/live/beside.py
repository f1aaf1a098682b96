"""Beside captures: the process that looks at each burst, seen from the program that takes them.

Nothing here waits or raises: whoever takes pictures is never held up by whoever looks at them. `LIVE` words are shown
as they are. The process begins with the first order, and ends with its owner or after a rest.
"""

import base64
import contextlib
import json
import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

_log = logging.getLogger(__name__)
# A scale reaches so far beyond the first picture of its series, in parts of its range: later ones are as warm.
_BEYOND = 0.25


class LiveState(StrEnum):
    """Shown to the operator by the same word."""

    off = "off"
    preparing = "preparing"
    ready = "ready"
    working = "working"
    missing = "missing"
    failed = "failed"


@dataclass(frozen=True)
class LivePlane:
    """T of one burst in the middle of the room, over x and z.

    `scale_k` is the same for all bursts of a series. `noise_k` is what the pictures' noise makes of it, rms;
    `took_s` how long it took once the burst was on the disk.
    """

    capture: str
    created: str
    kelvin: Float32[np.ndarray, "nx nz"]
    x_m: tuple[float, float]
    z_m: tuple[float, float]
    noise_k: float
    took_s: float
    scale_k: tuple[float, float]


@dataclass(frozen=True)
class LiveStatus:
    """What is being looked at, and the newest plane of this experiment; `reason` says what is missing or failed.

    `skipped` bursts of the series were passed over, because newer ones were there.
    """

    state: LiveState = LiveState.off
    experiment: str | None = None
    capture: str | None = None
    reason: str = ""
    skipped: int = 0
    plane: LivePlane | None = None


class LiveAir:
    """T of each burst as it comes; `tell(kind, body)` hears of every change, and never raises."""

    def __init__(self, tell: Callable[[str, Mapping[str, Any]], object] = lambda kind, body: None) -> None:
        self._tell = tell
        self._status = LiveStatus()
        self._lock = threading.Lock()
        self._changed = threading.Condition()
        self._process: subprocess.Popen[str] | None = None
        self._hearing: threading.Thread | None = None
        self._series: dict[str, str] = {}

    @property
    def status(self) -> LiveStatus:
        """The present state."""
        return self._status

    def prepare(self, experiment: Path) -> None:
        """Make ready for bursts of an experiment."""
        self._order({"experiment": str(experiment)})

    def look(self, experiment: Path, capture: Path, series: str = "") -> None:
        """Look at a burst that is on the disk; `series` names the one that it is of."""
        self._series[capture.name] = series or capture.name
        self._order({"experiment": str(experiment), "capture": str(capture)})

    def wait(self, capture: str, limit_s: float) -> LiveStatus:
        """Wait until there is an answer on a burst or a newer one, at most so long."""
        with self._changed:
            self._changed.wait_for(lambda: self._has_answered(capture), timeout=limit_s)
        return self._status

    def close(self) -> None:
        """End the process."""
        with self._lock:
            process, self._process = self._process, None
        if process is not None:
            process.kill()
            _end(process)
        if self._hearing is not None:
            self._hearing.join(timeout=10.0)

    def _has_answered(self, capture: str) -> bool:
        status = self._status
        ended = status.state in (LiveState.missing, LiveState.failed, LiveState.off)
        shown = status.plane is not None and status.plane.capture >= capture
        return shown or (ended and (status.capture or "") >= capture)

    def _order(self, order: dict[str, str]) -> None:
        try:
            with self._lock:
                pipe = self._running().stdin
                if pipe is not None:
                    pipe.write(json.dumps(order) + "\n")
                    pipe.flush()
        except OSError as error:
            self._change(
                LiveStatus(
                    LiveState.failed, reason=f"{error}. The captures go on without a live picture of T."
                )
            )

    def _running(self) -> subprocess.Popen[str]:
        """The process, begun again where it has ended."""
        if self._process is not None and self._process.poll() is not None:
            _end(self._process)
            self._process = None
        if self._process is None:
            variables = {name: value for name, value in os.environ.items() if "TOKEN" not in name}
            # Small sums on more threads would wait for each other, and take what the capture needs.
            variables |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
            command = [sys.executable, "-P", "-m", "app.live"]
            self._process = process = subprocess.Popen(
                command, env=variables, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
            self._hearing = threading.Thread(target=self._hear, args=(process,), name="live", daemon=True)
            self._hearing.start()
        return self._process

    def _hear(self, process: subprocess.Popen[str]) -> None:
        if process.stdout is not None:
            with process.stdout as told:
                for line in told:
                    self._heard(line)
        with self._lock:
            died = self._process is process
        if died:
            reason = "The process that looks at the bursts ended; the next burst begins it again."
            self._change(replace(self._status, state=LiveState.failed, reason=reason))

    def _heard(self, line: str) -> None:
        try:
            self._change(self._after(json.loads(line)))
        except (ValueError, KeyError) as error:
            _log.error("live: %s", error)

    def _after(self, told: dict[str, Any]) -> LiveStatus:
        """The status after what the process told."""
        before = self._status
        same = before.experiment == told["experiment"]
        plane = before.plane if same else None
        if "picture" in told:
            plane = self._plane(told["capture"], told["picture"], plane)
        series = self._series.get(told["capture"] or "")
        going_on = same and before.capture is not None and self._series.get(before.capture) == series
        skipped = told["skipped"] * (told["state"] == "working") + (before.skipped if going_on else 0)
        state, reason = LiveState(told["state"]), told.get("reason", "")
        return LiveStatus(state, told["experiment"], told["capture"], reason, skipped, plane)

    def _plane(self, capture: str, picture: dict[str, Any], before: LivePlane | None) -> LivePlane:
        kelvin = np.frombuffer(base64.b64decode(picture["kelvin"]), "<f4").reshape(picture["shape"])
        series = self._series.get(capture)
        if before is not None and self._series.get(before.capture) == series:
            scale_k = before.scale_k
        else:
            low, high = (float(end) for end in np.nanpercentile(kelvin[1:-1, 1:-1], (1, 99)))
            scale_k = (low - _BEYOND * (high - low), high + _BEYOND * (high - low))
        x_m, z_m = ((picture[name][0], picture[name][1]) for name in ("x_m", "z_m"))
        return LivePlane(
            capture, picture["created"], kelvin, x_m, z_m, picture["noise_k"], picture["took_s"], scale_k
        )

    def _change(self, status: LiveStatus) -> None:
        with self._changed:
            self._status = status
            self._changed.notify_all()
        names = ("experiment", "capture", "reason", "skipped")
        self._tell("live", {"state": status.state.value} | {name: getattr(status, name) for name in names})


def _end(process: subprocess.Popen[str]) -> None:
    """Give back what a process that has ended leaves; its answers are read to their end by who hears them."""
    process.wait()
    if process.stdin is not None:
        with contextlib.suppress(OSError):
            process.stdin.close()
