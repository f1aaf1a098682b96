"""What the ledger holds, as values: job, event, group, and what one submits."""

import json
import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.jobs.state import JobState

GIB = 1 << 30


@dataclass(frozen=True, kw_only=True)
class JobSpec:
    """What to compute. `settings` are JSON values that the kind checks.

    `memory_bytes` and `disk_bytes` are what the job may need at most; it waits until they are free.
    """

    kind: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    experiment: Path | None = None
    title: str = ""
    priority: int = 0
    memory_bytes: int = 1 * GIB
    disk_bytes: int = GIB // 8


@dataclass(frozen=True, kw_only=True)
class Job:
    """One row of the ledger. Times are seconds since 1970; `reason` says why it waits or ended."""

    id: str
    number: int
    kind: str
    settings: Mapping[str, Any]
    experiment: Path | None
    title: str
    group: str | None
    state: JobState
    priority: int
    memory_bytes: int
    disk_bytes: int
    attempt: int
    losses: int
    device: str | None
    engine: str | None
    handle: str | None
    step: int
    steps: int
    reason: str
    submitted_s: float
    started_s: float | None
    finished_s: float | None

    @property
    def progress(self) -> float:
        """Between 0 and 1; 0 when the number of steps is not known yet. What is done is whole: keeping a result and
        drawing its report are no steps.
        """
        if self.state is JobState.done:
            return 1.0
        return min(1.0, self.step / self.steps) if self.steps > 0 else 0.0


@dataclass(frozen=True, kw_only=True)
class Event:
    """One row of the event log; `id` only grows, so a reader asks for what came after its last."""

    id: int
    job: str | None
    attempt: int
    at_s: float
    kind: str
    body: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Group:
    """Jobs that belong together: the members of an ensemble or the points of a sweep."""

    id: str
    title: str
    created_s: float


def job_of(row: sqlite3.Row) -> Job:
    """Turn a row of `jobs` into a `Job`; settings that cannot be read are said in its reason."""
    values = {name: row[name] for name in row.keys() if name in Job.__dataclass_fields__}
    try:
        values["settings"] = dict(json.loads(row["settings"]))
    except (ValueError, TypeError, RecursionError) as error:
        values["settings"] = {}
        values["reason"] = (
            f"{row['reason']} The ledger's row of its settings cannot be read ({error}).".strip()
        )
    values["experiment"] = Path(row["experiment"]) if row["experiment"] else None
    values["state"] = JobState(row["state"])
    values["group"] = row["group_id"]
    return Job(**values)


def event_of(row: sqlite3.Row) -> Event:
    """Turn a row of `events` into an `Event`; a body that cannot be read says so."""
    try:
        body = dict(json.loads(row["body"]))
    except (ValueError, TypeError, RecursionError) as error:
        body = {"reason": f"This event of the ledger cannot be read ({type(error).__name__})."}
    return Event(
        id=row["id"],
        job=row["job_id"],
        attempt=row["attempt"],
        at_s=row["at_s"],
        kind=row["kind"],
        body=body,
    )
