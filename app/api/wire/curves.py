"""What jobs told while they ran, as columns: each event is read from the ledger only once."""

import math
import threading
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any

from app.jobs import Ledger

KEPT = 16
PAGE = 20_000
# Of a moment: where the job is, and how long yet.
_NO_CURVES = {"step", "steps", "left_s"}


class CurveCache:
    """The curves of the jobs that were asked for last."""

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger
        self._jobs: OrderedDict[str, _Told] = OrderedDict()
        self._lock = threading.Lock()

    def read(self, job: str, points: int) -> tuple[list[int], dict[str, list[float | None]]]:
        """Return steps and values by name, thinned evenly to at most `points`; the last step always stays."""
        with self._lock:
            told = self._jobs.setdefault(job, _Told())
            self._jobs.move_to_end(job)
            while len(self._jobs) > KEPT:
                self._jobs.popitem(last=False)
            told.catch_up(self._ledger, job)
            return told.columns(points)


class _Told:
    """One job's progress so far; a step that was told twice (after a resume) counts as told last."""

    def __init__(self) -> None:
        self._last_event = 0
        self._rows: dict[int, Mapping[str, Any]] = {}

    def catch_up(self, ledger: Ledger, job: str) -> None:
        while events := ledger.events(after=self._last_event, job=job, limit=PAGE):
            for event in events:
                if event.kind == "progress" and isinstance(event.body.get("step"), int):
                    step = event.body["step"]
                    self._rows[step] = {**self._rows.get(step, {}), **event.body}
            self._last_event = events[-1].id

    def columns(self, points: int) -> tuple[list[int], dict[str, list[float | None]]]:
        every = sorted(self._rows)
        stride = max(1, math.ceil(len(every) / max(1, points - 1)))
        steps = every[::stride]
        if every and steps[-1] != every[-1]:
            steps.append(every[-1])
        names = sorted({name for step in steps for name in self._rows[step]} - _NO_CURVES)
        return steps, {name: [_number(self._rows[step].get(name)) for step in steps] for name in names}


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
