"""What the process beside a capture does with an order, and what it tells of it."""

import base64
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from app.errors import AirlensError
from app.live.burst_draft import BurstDraft, BurstSeen
from core.setting import SettingError

Tell = Callable[[dict[str, Any]], object]


class Looking:
    """Keeps ready for one experiment at a time."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._ready: dict[Path, BurstDraft] = {}

    def carry_out(self, experiment: Path, capture: Path | None, skipped: int) -> None:
        """Make ready, and look at the burst if there is one; whatever fails is told."""
        about = {
            "experiment": experiment.name,
            "capture": capture.name if capture else None,
            "skipped": skipped,
        }
        try:
            draft = self._draft(experiment, about)
            if capture is None:
                self._tell({"state": "ready", **about})
                return
            self._tell({"state": "working", **about})
            began_s = time.perf_counter()
            seen = draft.of(capture)
            took_s = time.perf_counter() - began_s
            self._tell({"state": "ready", **about, "picture": _picture(seen, took_s)})
        except (AirlensError, SettingError, OSError) as error:
            # Without a calibration or a reference there is nothing to be seen yet; a burst may be no picture.
            state = "failed" if experiment in self._ready else "missing"
            self._tell({"state": state, **about, "reason": str(error)})
        except Exception as error:
            traceback.print_exception(error)
            self._tell(
                {"state": "failed", **about, "reason": f"{type(error).__name__}: {error}. This is a defect."}
            )

    def _draft(self, experiment: Path, about: dict[str, Any]) -> BurstDraft:
        kept = self._ready.get(experiment)
        if kept is not None and kept.is_current:
            return kept
        self._ready.clear()
        self._tell({"state": "preparing", **about})
        found = BurstDraft(experiment)
        # The reference against itself: what is compiled and read from the disk is so before the first burst.
        found.rehearse()
        self._ready[experiment] = found
        return found


def _picture(seen: BurstSeen, took_s: float) -> dict[str, Any]:
    """The middle plane [x, z] of T, as it goes through a pipe."""
    air = seen.solution
    plane = np.ascontiguousarray(air.temperature_k[:, air.temperature_k.shape[1] // 2], "<f4")
    return {
        "created": seen.created,
        "shape": plane.shape,
        "kelvin": base64.b64encode(plane.tobytes()).decode(),
        "x_m": [float(air.x_m[0]), float(air.x_m[-1])],
        "z_m": [float(air.z_m[0]), float(air.z_m[-1])],
        "noise_k": seen.noise_k,
        "took_s": took_s,
    }
