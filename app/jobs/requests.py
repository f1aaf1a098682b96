"""What a client may ask of a job, as changes of the ledger within one transaction."""

import json
import sqlite3
import time
from collections.abc import Mapping
from typing import Any

from app.jobs.errors import JobError, UnknownJobError
from app.jobs.state import JOB, JobEvent, JobState


def ask(database: sqlite3.Connection, job: str, event: JobEvent) -> None:
    """Carry out a request, or leave it to the supervisor. Raises JobError, UnknownJobError."""
    before = state_of(database, job)
    state = JOB.after(before, event, f"Job {job}")
    if state is before:
        return
    sql = (
        "UPDATE jobs SET state = ?, finished_s = ?, reason = '', "
        "losses = CASE WHEN ? THEN 0 ELSE losses END WHERE id = ?"
    )
    finished_s = time.time() if state.is_finished else None
    database.execute(sql, (state, finished_s, state is JobState.queued, job))
    log_event(database, job, 0, "state", {"state": state})


def move_before(database: sqlite3.Connection, job: str, other: str | None) -> None:
    """Number the queue anew with `job` before `other` (first when None), at that job's priority."""
    state_of(database, job)
    sql = "SELECT id, priority FROM jobs WHERE state = 'queued' AND id <> ? ORDER BY priority DESC, position"
    waiting = database.execute(sql, (job,)).fetchall()
    names = [row["id"] for row in waiting]
    if other is not None and other not in names:
        raise JobError(f"Job {other!r} is not in the queue, so nothing can be put before it.")
    at = names.index(other) if other else 0
    names.insert(at, job)
    for position, name in enumerate(names, start=1):
        database.execute("UPDATE jobs SET position = ? WHERE id = ?", (position, name))
    if waiting:
        database.execute("UPDATE jobs SET priority = ? WHERE id = ?", (waiting[at]["priority"], job))
    log_event(database, job, 0, "order", {"before": other})


def state_of(database: sqlite3.Connection, job: str) -> JobState:
    """Return a job's state. Raises UnknownJobError."""
    row = database.execute("SELECT state FROM jobs WHERE id = ?", (job,)).fetchone()
    if row is None:
        raise UnknownJobError(f"There is no job {job!r}. `airlens jobs list` shows all of them.")
    return JobState(row["state"])


def log_event(
    database: sqlite3.Connection,
    job: str | None,
    attempt: int,
    kind: str,
    body: Mapping[str, Any],
    *,
    at_s: float | None = None,
) -> int:
    """Append an event within a transaction; return its id."""
    values = (job, attempt, time.time() if at_s is None else at_s, kind, json.dumps(body, allow_nan=False))
    sql = "INSERT INTO events (job_id, attempt, at_s, kind, body) VALUES (?, ?, ?, ?, ?)"
    return database.execute(sql, values).lastrowid or 0
