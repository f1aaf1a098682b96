"""What becomes of a job that holds a device: published, ended, lost, silent, or asked to stop."""

import contextlib
import logging
import time
from dataclasses import dataclass
from pathlib import Path

from app.jobs import worker_status
from app.jobs.config import JobsConfig
from app.jobs.dispatch import Dispatch
from app.jobs.engines.engine import Engine, Launch, ProcessState
from app.jobs.errors import EngineError
from app.jobs.folder import JobFolder, is_held, read_json
from app.jobs.records import Job
from app.jobs.state import JobState

_log = logging.getLogger(__name__)
_FAREWELL_S = 5.0


@dataclass(frozen=True)
class _Sign:
    """The last sign of life of an attempt: the counter it showed and when this process first saw it."""

    attempt: int
    count: str
    seen_s: float


class Watch:
    """Judges active jobs. What it remembers are times alone, which a new one measures afresh."""

    def __init__(self, dispatch: Dispatch, engine: Engine, config: JobsConfig, folder: Path) -> None:
        self._dispatch, self._engine, self._config, self._folder = dispatch, engine, config, folder
        self._signs: dict[str, _Sign] = {}
        self._ending: dict[tuple[str, int], float] = {}
        self._told: dict[str, tuple[int, bool]] = {}

    def judge(self, job: Job) -> None:
        """Do what the state of its process, its files and its requests ask for, once."""
        folder = JobFolder(self._folder / job.id)
        # Alive is asked first: what a worker writes last is then seen below.
        state = self._process_state(job, folder)
        while self._dispatch.ingest(job, folder.attempt(job.attempt) / "events.jsonl"):
            pass
        goodbye = read_json(folder.attempt(job.attempt) / "exit.json")
        is_published = folder.is_published()
        if state is ProcessState.running and (is_published or goodbye is not None):
            self._see_off(job)  # the device is free when the process is gone, not before
        elif is_published:
            self._dispatch.conclude(job, JobState.done)
        elif goodbye is not None:
            self.part(job, goodbye["status"], goodbye["message"])
        elif state is ProcessState.gone:
            self.part(job, *self._last_word(job))
        elif self._is_silent(job, folder, state):
            self._abandon(job, folder)
        else:
            self._enforce_stop(job, folder)

    def _process_state(self, job: Job, folder: JobFolder) -> ProcessState:
        is_alive = is_held(folder.attempt(job.attempt) / "worker.lock")
        try:
            # No handle: the supervisor before was killed between the start and the note of it.
            handle = job.handle or self._engine.find(launch_of(job, self._folder, self._config))
            if handle is not None and handle != job.handle:
                self._dispatch.record_handle(job.id, job.attempt, handle)
            if is_alive:
                return ProcessState.running
            return ProcessState.gone if handle is None else self._engine.state(handle)
        except EngineError as error:
            _log.warning("%s", error)
            return ProcessState.running if is_alive else ProcessState.unknown

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

    def part(self, job: Job, status: int, message: str) -> None:
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
        self.part(job, worker_status.VANISHED, message)

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


def launch_of(job: Job, folder: Path, config: JobsConfig) -> Launch:
    """Return what an engine must know of a job's present attempt."""
    return Launch(
        job=job.id,
        attempt=job.attempt,
        folder=folder / job.id,
        device=job.device or config.devices[0],
        memory_bytes=job.memory_bytes,
        lease_s=config.lease_s,
    )
