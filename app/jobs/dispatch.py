"""The supervisor's side of the ledger: every change of state that a client may not make."""

import json
import secrets
import sqlite3
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from app.jobs.folder import Owner
from app.jobs.ledger import Ledger
from app.jobs.records import Job, job_of
from app.jobs.requests import log_event
from app.jobs.state import ACTIVE, JobState

_FREE = "device = NULL, handle = NULL, stop_asked_s = NULL"
# A request may have come in since the job was read: then the next round decides anew.
_UNCHANGED = "WHERE id = ? AND attempt = ? AND state = ?"


class Dispatch:
    """Changes of state, each one transaction. Only the one supervisor uses it."""

    def __init__(self, ledger: Ledger) -> None:
        self._store = ledger.store
        self._ledger = ledger

    def active(self) -> list[Job]:
        """Return the jobs that hold a device."""
        return self._ledger.jobs(states=ACTIVE)

    def next_waiting(self, now_s: float) -> list[Job]:
        """Return the jobs that may start now, the first in line first."""
        sql = (
            "SELECT * FROM jobs WHERE state = 'queued' OR (state = 'lost' AND retry_at_s <= ?) "
            "ORDER BY priority DESC, position"
        )
        return [job_of(row) for row in self._store.rows(sql, (now_s,))]

    def begin(self, job: str, device: str, engine: str) -> Owner | None:
        """Give the job the device and a new attempt; None when it was cancelled or the device taken."""
        token = secrets.token_hex(16)
        sql = (
            "UPDATE jobs SET state = 'running', device = ?, engine = ?, handle = NULL, token = ?, "
            "attempt = attempt + 1, event_offset = 0, retry_at_s = NULL, reason = '', "
            "started_s = COALESCE(started_s, ?) "
            "WHERE id = ? AND state IN ('queued', 'lost') RETURNING attempt"
        )
        try:
            with self._store.transaction() as database:
                rows = database.execute(sql, (device, engine, token, time.time(), job)).fetchall()
                if not rows:
                    return None
                attempt = rows[0][0]
                body = {"state": JobState.running, "device": device, "engine": engine}
                log_event(database, job, attempt, "state", body)
        except sqlite3.IntegrityError:
            return None
        return Owner(attempt=attempt, token=token)

    def record_handle(self, job: str, attempt: int, handle: str) -> None:
        """Remember how the engine calls the attempt's process."""
        with self._store.transaction() as database:
            sql = "UPDATE jobs SET handle = ? WHERE id = ? AND attempt = ?"
            database.execute(sql, (handle, job, attempt))

    def stop_asked_s(self, job: str) -> float | None:
        """Return when the job was asked to stop."""
        return self._store.rows("SELECT stop_asked_s FROM jobs WHERE id = ?", (job,))[0][0]

    def ingest(self, job: Job, path: Path) -> int:
        """Copy new whole lines of an attempt's events into the ledger, each exactly once; return how many."""
        start = self._store.rows("SELECT event_offset FROM jobs WHERE id = ?", (job.id,))[0][0]
        lines, end = _whole_lines(path, start)
        if end == start:
            return 0
        with self._store.transaction() as database:
            for line in lines:
                _ingest_line(database, job, line)
            sql = "UPDATE jobs SET event_offset = ? WHERE id = ? AND attempt = ?"
            database.execute(sql, (end, job.id, job.attempt))
        return len(lines)

    def conclude(self, job: Job, state: JobState, reason: str = "") -> None:
        """End the attempt in `state` and free the device, unless the job has changed since it was read."""
        sql = f"UPDATE jobs SET state = ?, reason = ?, finished_s = ?, {_FREE} {_UNCHANGED}"
        finished_s = time.time() if state.is_finished else None
        self._move(job, state, reason, sql, (state, reason, finished_s))

    def lose(self, job: Job, losses: int, retry_at_s: float, reason: str) -> None:
        """Note a lost worker; the job is tried again from `retry_at_s`."""
        sql = (
            "UPDATE jobs SET state = 'lost', losses = ?, step_at_loss = step, retry_at_s = ?, reason = ?, "
            f"{_FREE} {_UNCHANGED}"
        )
        self._move(job, JobState.lost, reason, sql, (losses, retry_at_s, reason))

    def _move(self, job: Job, state: JobState, reason: str, sql: str, values: Sequence[Any]) -> None:
        with self._store.transaction() as database:
            changed = database.execute(sql, (*values, job.id, job.attempt, job.state)).rowcount
            if changed:
                log_event(database, job.id, job.attempt, "state", {"state": state, "reason": reason})

    def has_advanced(self, job: Job) -> bool:
        """True when the job got further than at its last loss."""
        row = self._store.rows("SELECT step, step_at_loss FROM jobs WHERE id = ?", (job.id,))[0]
        return row["step"] > row["step_at_loss"]

    def explain_wait(self, job: Job, reason: str) -> None:
        """Say why a job waits; written only when it changes."""
        if reason and job.reason != reason:
            with self._store.transaction() as database:
                database.execute("UPDATE jobs SET reason = ? WHERE id = ?", (reason, job.id))
                log_event(database, job.id, job.attempt, "wait", {"reason": reason})


def _whole_lines(path: Path, start: int) -> tuple[list[bytes], int]:
    try:
        with open(path, "rb") as file:
            file.seek(start)
            content = file.read(1 << 20)
    except FileNotFoundError:
        return [], start
    whole = content[: content.rfind(b"\n") + 1]
    return whole.splitlines(), start + len(whole)


def _ingest_line(database: sqlite3.Connection, job: Job, line: bytes) -> None:
    try:
        content = json.loads(line)
        kind, body, at_s = str(content["kind"]), dict(content["body"]), float(content["at_s"])
        step, steps = int(body.get("step", 0)), int(body.get("steps", 0))
    except (ValueError, KeyError, TypeError):
        return  # a line torn by a power cut
    log_event(database, job.id, job.attempt, kind, body, at_s=at_s)
    if kind == "progress":
        sql = "UPDATE jobs SET step = ?, steps = ? WHERE id = ? AND attempt = ?"
        database.execute(sql, (step, steps, job.id, job.attempt))
