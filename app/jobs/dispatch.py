"""The supervisor's side of the ledger: every change of state that a client may not make."""

import secrets
import sqlite3
import time
from pathlib import Path

from app.jobs.folder import Owner
from app.jobs.ledger import Ledger
from app.jobs.records import Job
from app.jobs.requests import log_event, state_of
from app.jobs.state import ACTIVE, JOB, WAITING, JobEvent, JobState
from app.jobs.told import told, whole_lines


class Dispatch:
    """Changes of state, each one transaction. Only the one supervisor uses it."""

    def __init__(self, ledger: Ledger) -> None:
        self._store = ledger.store
        self._ledger = ledger

    def active(self) -> list[Job]:
        """Return the jobs that hold a device."""
        return self._ledger.jobs(states=ACTIVE)

    def now(self, job: Job) -> Job:
        """Return the job as the ledger has it now."""
        return self._ledger.get(job.id)

    def waiting(self) -> list[Job]:
        """Return the jobs that wait to start, the first in line first."""
        return self._ledger.jobs(states=WAITING, limit=-1)

    def begin(self, job: str, device: str, engine: str) -> Owner | None:
        """Give the job the device and a new attempt; None when it was cancelled or the device taken."""
        token = secrets.token_hex(16)
        sql = (
            "UPDATE jobs SET state = ?, device = ?, engine = ?, handle = NULL, token = ?, "
            "attempt = attempt + 1, event_offset = 0, reason = '', "
            "started_s = COALESCE(started_s, ?) WHERE id = ? RETURNING attempt"
        )
        try:
            with self._store.transaction() as database:
                state = state_of(database, job)
                if not JOB.allows(state, JobEvent.begin):
                    return None
                after = JOB.after(state, JobEvent.begin)
                values = (after, device, engine, token, time.time(), job)
                attempt = database.execute(sql, values).fetchone()[0]
                log_event(
                    database, job, attempt, "state", {"state": after, "device": device, "engine": engine}
                )
        except sqlite3.IntegrityError:
            return None
        return Owner(attempt=attempt, token=token)

    def record_handle(self, job: str, attempt: int, handle: str) -> None:
        """Remember how the engine calls the attempt's process."""
        with self._store.transaction() as database:
            sql = "UPDATE jobs SET handle = ? WHERE id = ? AND attempt = ?"
            database.execute(sql, (handle, job, attempt))

    def ingest(self, job: Job, path: Path) -> int:
        """Copy new whole lines of an attempt's events into the ledger, each exactly once; return how many."""
        start = self._store.rows("SELECT event_offset FROM jobs WHERE id = ?", (job.id,))[0][0]
        lines, end = whole_lines(path, start)
        if end == start:
            return 0
        with self._store.transaction() as database:
            for line in map(told, lines):
                log_event(database, job.id, job.attempt, line.kind, line.body, at_s=line.at_s)
                if line.kind == "progress":
                    sql = "UPDATE jobs SET step = ?, steps = ? WHERE id = ? AND attempt = ?"
                    database.execute(sql, (line.step, line.steps, job.id, job.attempt))
            sql = "UPDATE jobs SET event_offset = ? WHERE id = ? AND attempt = ?"
            database.execute(sql, (end, job.id, job.attempt))
        return len(lines)

    def move(self, job: Job, event: JobEvent, reason: str = "", *, losses: int | None = None) -> None:
        """Let `event` happen and free the device, unless the job has changed since it was read.

        `losses` are noted with a lost worker, and how far the job had come.
        """
        state = JOB.after(job.state, event, f"Job {job.id}")
        # A request may have come in since the job was read: then the next round decides anew.
        sql = (
            "UPDATE jobs SET state = ?, reason = ?, finished_s = ?, losses = COALESCE(?, losses), "
            "step_at_loss = CASE WHEN ? THEN step ELSE step_at_loss END, device = NULL, handle = NULL "
            "WHERE id = ? AND attempt = ? AND state = ?"
        )
        finished_s = time.time() if state.is_finished else None
        noted = (state, reason, finished_s, losses, state is JobState.lost)
        with self._store.transaction() as database:
            if database.execute(sql, (*noted, job.id, job.attempt, job.state)).rowcount:
                log_event(database, job.id, job.attempt, "state", {"state": state, "reason": reason})

    def has_advanced(self, job: Job) -> bool:
        """True when the job got further than at its last loss."""
        row = self._store.rows("SELECT step, step_at_loss FROM jobs WHERE id = ?", (job.id,))[0]
        return row["step"] > row["step_at_loss"]

    def explain(self, job: Job, reason: str) -> None:
        """Say why a job waits or what troubles it; written only when it changes."""
        if job.reason != reason:
            with self._store.transaction() as database:
                database.execute("UPDATE jobs SET reason = ? WHERE id = ?", (reason, job.id))
                log_event(database, job.id, job.attempt, "wait", {"reason": reason})
