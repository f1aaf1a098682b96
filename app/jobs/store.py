"""The ledger's database: SQLite in WAL mode with a full sync at every commit.

With `synchronous=NORMAL` a power cut loses acknowledged commits; with `FULL` it does not. Never put it
on a network file system: SQLite's locks do not hold there.
"""

import contextlib
import shutil
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from app.files.durable import make_folder, sync
from app.jobs.errors import LedgerError
from app.jobs.state import ACTIVE, JobState

SCHEMA = 2
_FULL_BYTES = 1 << 16
_ACTIVE = ", ".join(f"'{state}'" for state in ACTIVE)
_STATES = ", ".join(f"'{state}'" for state in JobState)

_TABLES = f"""
CREATE TABLE groups (
  id TEXT PRIMARY KEY, title TEXT NOT NULL, created_s REAL NOT NULL
) STRICT;
CREATE TABLE jobs (
  number INTEGER PRIMARY KEY AUTOINCREMENT,
  id TEXT NOT NULL UNIQUE,
  submit_key TEXT UNIQUE,
  group_id TEXT REFERENCES groups (id),
  kind TEXT NOT NULL,
  settings TEXT NOT NULL,
  experiment TEXT,
  title TEXT NOT NULL,
  memory_bytes INTEGER NOT NULL,
  disk_bytes INTEGER NOT NULL,
  state TEXT NOT NULL CHECK (state IN ({_STATES})),
  priority INTEGER NOT NULL,
  position REAL NOT NULL,
  attempt INTEGER NOT NULL DEFAULT 0,
  token TEXT NOT NULL DEFAULT '',
  losses INTEGER NOT NULL DEFAULT 0,
  step_at_loss INTEGER NOT NULL DEFAULT -1,
  device TEXT,
  engine TEXT,
  handle TEXT,
  step INTEGER NOT NULL DEFAULT 0,
  steps INTEGER NOT NULL DEFAULT 0,
  event_offset INTEGER NOT NULL DEFAULT 0,
  reason TEXT NOT NULL DEFAULT '',
  submitted_s REAL NOT NULL,
  started_s REAL,
  finished_s REAL,
  CHECK ((device IS NOT NULL) = (state IN ({_ACTIVE})))
) STRICT;
CREATE UNIQUE INDEX one_job_a_device ON jobs (device) WHERE device IS NOT NULL;
CREATE INDEX jobs_in_order ON jobs (state, priority DESC, position);
CREATE INDEX jobs_in_group ON jobs (group_id);
CREATE TABLE events (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  job_id TEXT REFERENCES jobs (id),
  attempt INTEGER NOT NULL,
  at_s REAL NOT NULL,
  kind TEXT NOT NULL,
  body TEXT NOT NULL
) STRICT;
CREATE INDEX events_of_job ON events (job_id, id);
"""


class Store:
    """Connections to one database file, one a thread; transactions that either happen or do not."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._local = threading.local()
        make_folder(path.parent)
        try:
            self._create()
            sync(path.parent)
        except BaseException:
            self.close()
            raise

    def _create(self) -> None:
        with self.transaction() as database:
            found = database.execute("PRAGMA user_version").fetchone()[0]
            if found == 0:
                for statement in filter(str.strip, _TABLES.split(";")):
                    database.execute(statement)
                database.execute(f"PRAGMA user_version = {SCHEMA}")
            elif found == 1:
                # Moments of the wall clock, which may be set back.
                for column in ("retry_at_s", "stop_asked_s"):
                    database.execute(f"ALTER TABLE jobs DROP COLUMN {column}")
                database.execute(f"PRAGMA user_version = {SCHEMA}")
            elif found != SCHEMA:
                raise LedgerError(
                    f"{self._path} has schema {found}; this version reads schema {SCHEMA}. "
                    "Use the version of airlens that wrote it, or start with an empty folder."
                )

    @contextlib.contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Yield the connection inside BEGIN IMMEDIATE; commit at the end, roll back on any error.

        Raises LedgerError when the disk is full, the file is locked for too long or is no ledger.
        """
        try:
            database = self._connection()
            database.execute("BEGIN IMMEDIATE")
            try:
                yield database
                database.execute("COMMIT")
            except BaseException:
                # After a full disk SQLite has rolled back by itself.
                if database.in_transaction:
                    database.execute("ROLLBACK")
                raise
        except sqlite3.IntegrityError:
            raise
        except sqlite3.DatabaseError as error:
            raise _explained(self._path, error) from error

    def rows(self, sql: str, values: Sequence[Any] = ()) -> list[sqlite3.Row]:
        """Return all rows of a query; readers never wait for the writer."""
        try:
            return self._connection().execute(sql, values).fetchall()
        except sqlite3.DatabaseError as error:
            raise _explained(self._path, error) from error

    def close(self) -> None:
        """Close this thread's connection."""
        database = self._local.__dict__.pop("database", None)
        if database is not None:
            database.close()

    def _connection(self) -> sqlite3.Connection:
        database = getattr(self._local, "database", None)
        if database is None:
            database = sqlite3.connect(self._path, isolation_level=None, timeout=20.0)
            self._local.database = database
            database.row_factory = sqlite3.Row
            # A damaged text is shown as it is, not refused with its whole list.
            database.text_factory = lambda content: content.decode("utf-8", "replace")
            try:
                for setting in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
                    database.execute(f"PRAGMA {setting}")
            except sqlite3.DatabaseError:
                self.close()
                raise
        return database


def _explained(path: Path, error: sqlite3.DatabaseError) -> LedgerError:
    cause = str(error)
    with contextlib.suppress(OSError):
        # A full disk shows as an "I/O error" or a file that cannot be opened, too.
        if shutil.disk_usage(path.parent).free < _FULL_BYTES:
            cause = f"the disk is full ({error})"
    return LedgerError(
        f"The job ledger {path} could not be used: {cause}. What was acknowledged before is kept, this "
        "change is not. Free space on its disk, or check that it is on a local, writable disk; then repeat."
    )
