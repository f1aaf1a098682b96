"""The ledger of jobs: what a client (command line, service, notebook) may ask.

A folder holds everything: `ledger.sqlite` and one folder a job. Whatever a call returned survives a
power cut. Requests (cancel, pause) change the state here; the supervisor carries them out.
"""

import json
import secrets
import shutil
import sqlite3
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from app.errors import BadInputError
from app.files.durable import make_folder, write_json
from app.jobs import kinds
from app.jobs.errors import JobError, UnknownJobError
from app.jobs.records import Event, Group, Job, JobSpec, event_of, job_of
from app.jobs.requests import ask, log_event, move_before, state_of
from app.jobs.state import JobEvent, JobState
from app.jobs.store import Store

_INSERT = """
INSERT INTO jobs (id, submit_key, group_id, kind, settings, experiment, title, memory_bytes, disk_bytes,
                  state, priority, position, submitted_s)
VALUES (:id, :key, :group, :kind, :settings, :experiment, :title, :memory_bytes, :disk_bytes,
        'queued', :priority, (SELECT COALESCE(MAX(position), 0) + 1 FROM jobs), :now_s)
"""

_MOST = 1 << 62


class Ledger:
    """Jobs, their order and their events. Safe to use from several threads and processes."""

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder).resolve()
        self.store = Store(self.folder / "ledger.sqlite")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close this thread's connection; the next call opens it again."""
        self.store.close()

    def folder_of(self, job: str) -> Path:
        """Return the job's own folder."""
        return self.folder / self.get(job).id

    # Submitting

    def submit(self, spec: JobSpec, *, key: str | None = None, group: str | None = None) -> Job:
        """Queue one job; when this returns, the job survives a power cut.

        The same `key` twice gives the first job again, so that a client may repeat a request whose
        answer it did not see. Raises BadInputError for an unknown kind or a setting that it refuses.
        """
        known = self._submitted_as(key)
        if known is not None:
            return known
        try:
            return self.submit_many([spec], keys=[key], group=group)[0]
        except JobError:
            known = self._submitted_as(key)  # by another thread or process, meanwhile
            if known is None:
                raise
            return known

    def submit_many(
        self, specs: Sequence[JobSpec], *, keys: Sequence[str | None] | None = None, group: str | None = None
    ) -> list[Job]:
        """Queue all jobs or none, in the order given."""
        keys = [None] * len(specs) if keys is None else keys
        rows = [_row_of(spec, key, group) for spec, key in zip(specs, keys, strict=True)]
        try:
            for row in rows:
                self._make_folder(row)
            with self.store.transaction() as database:
                for row in rows:
                    database.execute(_INSERT, row)
                    log_event(database, row["id"], 0, "state", {"state": JobState.queued})
        except Exception as error:
            for row in rows:
                shutil.rmtree(self.folder / row["id"], ignore_errors=True)
            if not isinstance(error, sqlite3.IntegrityError):
                raise
            raise JobError(
                f"The jobs were not queued: {error}. A submission key or a group is not what it should be; "
                "use a fresh key, and create the group first."
            ) from error
        return [self.get(row["id"]) for row in rows]

    def create_group(self, title: str) -> Group:
        """Return a new group for the members of an ensemble or the points of a sweep."""
        group = Group(id=f"g{secrets.token_hex(6)}", title=title, created_s=time.time())
        with self.store.transaction() as database:
            values = (group.id, group.title, group.created_s)
            database.execute("INSERT INTO groups (id, title, created_s) VALUES (?, ?, ?)", values)
        return group

    # Reading

    def get(self, job: str) -> Job:
        """Return one job. Raises UnknownJobError."""
        rows = self.store.rows("SELECT * FROM jobs WHERE id = ?", (job,))
        if not rows:
            raise UnknownJobError(f"There is no job {job!r}. `airlens jobs list` shows all of them.")
        return job_of(rows[0])

    def jobs(
        self, *, states: Iterable[JobState] | None = None, group: str | None = None, limit: int = 1000
    ) -> list[Job]:
        """Return jobs: active ones first, then waiting ones in order, then ended ones, newest first."""
        chosen = [str(state) for state in (JobState if states is None else states)]
        marks = ", ".join("?" * len(chosen))
        condition = f"state IN ({marks})" + ("" if group is None else " AND group_id = ?")
        order = "device IS NULL, finished_s IS NOT NULL, finished_s DESC, priority DESC, position LIMIT ?"
        values = [*chosen, *([] if group is None else [group]), limit]
        found = self.store.rows(f"SELECT * FROM jobs WHERE {condition} ORDER BY {order}", values)
        return [job_of(row) for row in found]

    def groups(self) -> list[Group]:
        """Return all groups, newest first."""
        found = self.store.rows("SELECT * FROM groups ORDER BY created_s DESC")
        return [Group(id=row["id"], title=row["title"], created_s=row["created_s"]) for row in found]

    def events(self, *, after: int = 0, job: str | None = None, limit: int = 1000) -> list[Event]:
        """Return the events whose id is above `after`, oldest first: the replay of a stream."""
        condition = "id > ?" + ("" if job is None else " AND job_id = ?")
        values = [after, *([] if job is None else [job]), limit]
        found = self.store.rows(f"SELECT * FROM events WHERE {condition} ORDER BY id LIMIT ?", values)
        return [event_of(row) for row in found]

    def last_event(self) -> int:
        """Return the id of the newest event, 0 when there is none."""
        return self.store.rows("SELECT COALESCE(MAX(id), 0) FROM events")[0][0]

    # Requests

    def cancel(self, job: str) -> Job:
        """Stop the job: it keeps its checkpoint and may be retried. Raises JobError when it has ended."""
        return self._ask(job, JobEvent.cancel)

    def pause(self, job: str) -> Job:
        """Stop the job at a checkpoint until `resume`."""
        return self._ask(job, JobEvent.pause)

    def resume(self, job: str) -> Job:
        """Queue a paused job again; it goes on from its checkpoint."""
        return self._ask(job, JobEvent.resume)

    def retry(self, job: str) -> Job:
        """Queue a failed, cancelled or lost job again; it goes on from its checkpoint."""
        return self._ask(job, JobEvent.retry)

    def set_priority(self, job: str, priority: int) -> Job:
        """Higher priorities start first; equal ones in their order. Raises BadInputError for an extreme one."""
        _bounded(priority=priority)
        with self.store.transaction() as database:
            state_of(database, job)
            database.execute("UPDATE jobs SET priority = ? WHERE id = ?", (priority, job))
            log_event(database, job, 0, "priority", {"priority": priority})
        return self.get(job)

    def move_before(self, job: str, other: str | None = None) -> Job:
        """Put the job before `other` (before all when None), at that job's priority."""
        with self.store.transaction() as database:
            move_before(database, job, other)
        return self.get(job)

    def append_event(self, kind: str, body: Mapping[str, Any], *, job: str | None = None) -> int:
        """Append an event that does not come from a worker (devices, log); return its id."""
        with self.store.transaction() as database:
            return log_event(database, job, 0, kind, body)

    def _ask(self, job: str, event: JobEvent) -> Job:
        with self.store.transaction() as database:
            ask(database, job, event)
        return self.get(job)

    def _submitted_as(self, key: str | None) -> Job | None:
        rows = self.store.rows("SELECT * FROM jobs WHERE submit_key = ?", (key,)) if key else []
        return job_of(rows[0]) if rows else None

    def _make_folder(self, row: Mapping[str, Any]) -> None:
        folder = self.folder / row["id"]
        make_folder(folder / "attempts")
        names = ("id", "kind", "experiment", "title")
        content = {name: row[name] for name in names} | {"settings": json.loads(row["settings"])}
        content["submitted_s"] = row["now_s"]
        write_json(folder / "job.json", content)


def _row_of(spec: JobSpec, key: str | None, group: str | None) -> dict[str, Any]:
    kinds.check(spec.kind, spec.settings, spec.experiment)
    _bounded(priority=spec.priority, memory_bytes=spec.memory_bytes, disk_bytes=spec.disk_bytes)
    return {
        "id": f"j{secrets.token_hex(6)}",
        "key": key,
        "group": group,
        "kind": spec.kind,
        "settings": json.dumps(dict(spec.settings), allow_nan=False, sort_keys=True),
        "experiment": str(Path(spec.experiment).resolve()) if spec.experiment else None,
        "title": spec.title or spec.kind,
        "memory_bytes": spec.memory_bytes,
        "disk_bytes": spec.disk_bytes,
        "priority": spec.priority,
        "now_s": time.time(),
    }


def _bounded(**numbers: int) -> None:
    """Raise BadInputError for a number that no column of the ledger holds."""
    for name, value in numbers.items():
        if abs(value) > _MOST:
            raise BadInputError(f"{name} is beyond 2^62, more than the ledger holds. Give a smaller number.")
