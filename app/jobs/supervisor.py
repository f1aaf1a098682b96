"""The one process that turns requests into workers and reports into states.

Each round looks at every active job (published? ended? alive? asked to stop?) and then fills the free
devices. Nothing is kept in memory that a new supervisor could not find again: it may be killed at any
moment, and the next one adopts the workers that live on.
"""

import contextlib
import logging
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

from app.jobs import worker_status
from app.jobs.admission import disk_shortage, memory_shortage
from app.jobs.config import JobsConfig
from app.jobs.dispatch import Dispatch
from app.jobs.engine import Engine, Launch, ProcessState
from app.jobs.engines import create_engine
from app.jobs.errors import EngineError, JobError, LedgerError
from app.jobs.folder import JobFolder, is_held, read_json, try_lock
from app.jobs.ledger import Ledger
from app.jobs.local import LocalEngine
from app.jobs.records import Job
from app.jobs.state import JobState
from app.jobs.study import MOST_JOBS, keep_summary

_log = logging.getLogger(__name__)
_FAREWELL_S = 5.0


@dataclass(frozen=True)
class _Sign:
    """The last sign of life of an attempt: the counter it showed and when this process first saw it."""

    attempt: int
    count: str
    seen_s: float


class Supervisor:
    """Runs the queue of one ledger. A second one for the same folder is refused."""

    def __init__(self, ledger: Ledger, config: JobsConfig, engine: Engine | None = None) -> None:
        self._ledger = ledger
        self._config = config
        self._engine = create_engine(config, ledger.folder) if engine is None else engine
        self._dispatch = Dispatch(ledger)
        self._signs: dict[str, _Sign] = {}
        self._ending: dict[tuple[str, int], float] = {}
        self._told: dict[str, tuple[int, bool]] = {}

    def run(self, stop: threading.Event) -> None:
        """Work until `stop` is set; running jobs go on and are adopted by the next supervisor.

        Raises JobError when another supervisor has this folder, EngineError when the engine is not safe.
        """
        with self._only_one(), contextlib.closing(self._engine):
            self._engine.probe()
            while not stop.is_set():
                try:
                    self.round()
                except (LedgerError, OSError) as error:
                    # A full disk, most likely: nothing was half done, so the next round goes on.
                    _log.error("%s", error)
                    stop.wait(10 * self._config.poll_s)
                stop.wait(self._config.poll_s)

    def round(self) -> None:
        """Look at every active job once, then start what fits."""
        for job in self._dispatch.active():
            self._judge(job)
            if job.group and not self._ledger.get(job.id).state.is_active:
                self._sum_up(job.group)
        self._fill()

    def _sum_up(self, group: str) -> None:
        """Keep the summary of a group whose last job has ended."""
        if all(job.state.is_finished for job in self._ledger.jobs(group=group, limit=MOST_JOBS)):
            keep_summary(self._ledger, group)

    @contextlib.contextmanager
    def _only_one(self) -> Iterator[None]:
        lock = try_lock(self._ledger.folder / "supervisor.lock")
        if lock is None:
            raise JobError(
                f"Another supervisor already runs the jobs in {self._ledger.folder}. "
                "One is enough: submit to it, or stop it first."
            )
        with lock:
            yield

    # One active job

    def _judge(self, job: Job) -> None:
        folder = JobFolder(self._ledger.folder / job.id)
        # Alive is asked first: what a worker writes last is then seen below.
        state = self._process_state(job, folder)
        self._dispatch.ingest(job, folder.attempt(job.attempt) / "events.jsonl")
        goodbye = read_json(folder.attempt(job.attempt) / "exit.json")
        is_published = folder.is_published()
        if state is ProcessState.running and (is_published or goodbye is not None):
            self._see_off(job)  # the device is free when the process is gone, not before
        elif is_published:
            self._dispatch.conclude(job, JobState.done)
        elif goodbye is not None:
            self._part(job, goodbye["status"], goodbye["message"])
        elif state is ProcessState.gone:
            self._part(job, *self._last_word(job))
        elif self._is_silent(job, folder, state):
            self._abandon(job, folder)
        else:
            self._enforce_stop(job, folder)

    def _process_state(self, job: Job, folder: JobFolder) -> ProcessState:
        if is_held(folder.attempt(job.attempt) / "worker.lock"):
            return ProcessState.running
        handle = job.handle or self._engine.find(self._launch(job))
        if handle is None:
            return ProcessState.gone
        if handle != job.handle:
            self._dispatch.record_handle(job.id, job.attempt, handle)
        try:
            return self._engine.state(handle)
        except EngineError as error:
            _log.warning("%s", error)
            return ProcessState.unknown

    def _see_off(self, job: Job) -> None:
        """Let a worker that has finished end; one that hangs in its last moments is killed."""
        since_s = self._ending.setdefault((job.id, job.attempt), time.monotonic())
        if time.monotonic() - since_s > _FAREWELL_S and job.handle:
            with contextlib.suppress(EngineError):
                self._engine.stop(job.handle, kill=True)

    def _last_word(self, job: Job) -> tuple[int, str]:
        """Return status and message of a worker that left no exit.json."""
        status = None
        with contextlib.suppress(EngineError):
            status = self._engine.exit_status(job.handle) if job.handle else None
        if status == worker_status.NO_SPACE:
            return status, "The disk was full; nothing half-written was kept. Free space on it."
        told = "without a word" if status is None else f"without a word, with status {status}"
        return worker_status.VANISHED, f"The worker ended {told}."

    def _part(self, job: Job, status: int, message: str) -> None:
        """Decide what a worker's end means for its job."""
        if status == worker_status.FAILED:
            self._dispatch.conclude(job, JobState.failed, message)
        elif job.state is JobState.cancelling:
            self._dispatch.conclude(job, JobState.cancelled)
        elif job.state is JobState.pausing:
            self._dispatch.conclude(job, JobState.paused)
        else:
            self._lose(
                job,
                message or "The worker was stopped from outside.",
                no_space=status == worker_status.NO_SPACE,
            )

    def _lose(self, job: Job, message: str, *, no_space: bool = False) -> None:
        losses = 1 if self._dispatch.has_advanced(job) else job.losses + 1
        if losses > self._config.max_losses and not no_space:
            reason = (
                f"{message} That was loss {losses} in a row without progress, so it is not tried again. "
                "Read log.txt in the last attempt's folder; `retry` goes on from the checkpoint."
            )
            self._dispatch.conclude(job, JobState.failed, reason)
            return
        pause_s = min(self._config.retry_first_s * 2 ** (losses - 1), self._config.retry_longest_s)
        self._dispatch.lose(job, losses, time.time() + pause_s, f"{message} It is tried again.")

    def _is_silent(self, job: Job, folder: JobFolder, state: ProcessState) -> bool:
        """True when a started worker has not renewed its lease for too long."""
        try:
            count = (folder.attempt(job.attempt) / "heartbeat").read_text(encoding="ascii")
        except OSError:
            count = ""
        now_s = time.monotonic()
        sign = self._signs.get(job.id)
        is_new = sign is None or (sign.attempt, sign.count) != (job.attempt, count)
        if sign is None or is_new or state is ProcessState.pending:
            self._signs[job.id] = sign = _Sign(job.attempt, count, now_s)
        limit_s = self._config.lease_s if count else self._config.start_limit_s
        return now_s - sign.seen_s > limit_s

    def _abandon(self, job: Job, folder: JobFolder) -> None:
        """Give up a silent worker. It may still be alive: the fence keeps it from publishing."""
        self._kill(job, folder)
        message = f"The worker gave no sign of life for {self._config.lease_s:g} s."
        self._part(job, worker_status.VANISHED, message)

    def _kill(self, job: Job, folder: JobFolder) -> None:
        """End a worker for certain: by the engine, and where that fails by taking its lease."""
        with contextlib.suppress(TimeoutError):
            folder.revoke()
        with contextlib.suppress(EngineError):
            if job.handle:
                self._engine.stop(job.handle, kill=True)

    def _enforce_stop(self, job: Job, folder: JobFolder) -> None:
        asked_s = self._dispatch.stop_asked_s(job.id)
        if asked_s is None or job.handle is None:
            return
        kill = time.time() - asked_s > self._config.stop_limit_s
        if self._told.get(job.id) == (job.attempt, kill):
            return
        try:
            if kill:
                self._kill(job, folder)
            else:
                self._engine.stop(job.handle)
            self._told[job.id] = (job.attempt, kill)
        except EngineError as error:
            _log.warning("%s", error)

    # Starting

    def _fill(self) -> None:
        taken = {job.device for job in self._dispatch.active()}
        free = [device for device in self._config.devices if device not in taken]
        for job in self._dispatch.next_waiting(time.time()):
            if not free:
                return
            lack = self._lack_of(job)
            self._dispatch.explain_wait(job, lack)
            if not lack and self._start(job, free[0]):
                free.pop(0)

    def _lack_of(self, job: Job) -> str:
        """Return why the job cannot start now, or an empty string."""
        folder = JobFolder(self._ledger.folder / job.id)
        lack = disk_shortage(job, folder.path, self._config)
        if lack or not isinstance(self._engine, LocalEngine):
            return lack
        if job.attempt and is_held(folder.attempt(job.attempt) / "worker.lock"):
            # Started by a supervisor that was killed before it could note it. It has no result to lose
            # but the time since its checkpoint; two on one device would cost more.
            handle = self._engine.find(self._launch(job))
            if handle:
                self._engine.stop(handle, kill=True)
            return "Waiting for its last worker to end."
        return memory_shortage(job, self._dispatch.active(), self._engine, self._config)

    def _start(self, job: Job, device: str) -> bool:
        """Begin an attempt: ledger, then fence, then process. A kill between any two costs one attempt."""
        owner = self._dispatch.begin(job.id, device, self._engine.name)
        if owner is None:
            return False
        begun = self._ledger.get(job.id)
        folder = JobFolder(self._ledger.folder / job.id)
        try:
            folder.hand_over(owner)
            if folder.is_published():
                # The attempt before got there after it was given up, and before the fence closed.
                self._dispatch.conclude(begun, JobState.done)
                return False
            handle = self._engine.start(self._launch(begun))
        except (EngineError, TimeoutError) as error:
            self._part(begun, worker_status.VANISHED, str(error))
            return False
        self._dispatch.record_handle(job.id, owner.attempt, handle)
        return True

    def _launch(self, job: Job) -> Launch:
        return Launch(
            job=job.id,
            attempt=job.attempt,
            folder=self._ledger.folder / job.id,
            device=job.device or self._config.devices[0],
            memory_bytes=job.memory_bytes,
            lease_s=self._config.lease_s,
        )
