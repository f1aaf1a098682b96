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
from app.jobs.folder import JobFolder, is_held, last_lines, read_json
from app.jobs.records import Job
from app.jobs.state import JobEvent, JobState

_log = logging.getLogger(__name__)
_FAREWELL_S = 5.0


@dataclass(frozen=True)
class _Sign:
    """The last sign of life of an attempt: the counter it showed and when this process first saw it."""

    attempt: int
    count: str
    seen_s: float


class JobWatch:
    """Judges active jobs. What it remembers are times alone, which a new one measures afresh.

    All of them are monotonic: the wall clock may be set at any moment.
    """

    def __init__(self, dispatch: Dispatch, engine: Engine, config: JobsConfig, folder: Path) -> None:
        self._dispatch, self._engine, self._config, self._folder = dispatch, engine, config, folder
        self._signs: dict[str, _Sign] = {}
        self._ending: dict[tuple[str, int], float] = {}
        self._asked: dict[tuple[str, int], float] = {}
        self._told: dict[str, tuple[int, bool]] = {}

    def judge(self, job: Job) -> None:
        """Do what the state of its process, its files and its requests ask for, once."""
        folder = JobFolder(self._folder / job.id)
        # Alive is asked first: what a worker writes last is then seen below.
        state = self._process_state(job, folder)
        while self._dispatch.ingest(job, folder.attempt(job.attempt) / "events.jsonl"):
            pass
        goodbye = _goodbye(folder.attempt(job.attempt) / "exit.json")
        is_published = folder.is_published()
        if state is ProcessState.running and (is_published or goodbye is not None):
            self._see_off(job)  # the device is free when the process is gone, not before
        elif is_published:
            self._dispatch.move(job, JobEvent.finish)
        elif goodbye is not None:
            self.part(job, *goodbye)
        elif state is ProcessState.gone:
            self.part(job, *self._last_word(job, folder))
        elif silent_s := self._silent_s(job, folder, state):
            self._abandon(job, folder, silent_s)
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

    def _last_word(self, job: Job, folder: JobFolder) -> tuple[int, str]:
        """Return status and message of a worker that left no exit.json, with the end of its output."""
        status = None
        with contextlib.suppress(EngineError):
            status = self._engine.exit_status(job.handle) if job.handle else None
        if status == worker_status.NO_SPACE:
            return status, "The disk was full; nothing half-written was kept. Free space on it."
        told = "without a word" if status is None else f"without a word, with status {status}"
        output = last_lines(folder.attempt(job.attempt) / "log.txt")
        return worker_status.VANISHED, f"The worker ended {told}." + (
            f" Its last output: {output}." if output else ""
        )

    def part(self, job: Job, status: int, message: str) -> None:
        """Decide what a worker's end means for its job."""
        if status == worker_status.FAILED:
            self._dispatch.move(job, JobEvent.fail, message)
        elif job.state is not JobState.running:
            self._dispatch.move(job, JobEvent.end)  # as it was asked to
        else:
            full = status == worker_status.NO_SPACE
            self._lose(job, message or "The worker was stopped from outside.", no_space=full)

    def _lose(self, job: Job, message: str, *, no_space: bool = False) -> None:
        losses = 1 if self._dispatch.has_advanced(job) else job.losses + 1
        if losses > self._config.max_losses and not no_space:
            reason = (
                f"{message} That was loss {losses} in a row without progress, so it is not tried again. "
                "Read log.txt in the last attempt's folder; `retry` goes on from the checkpoint."
            )
            self._dispatch.move(job, JobEvent.fail, reason)
            return
        pause_s = pause_after(losses, self._config)
        reason = f"{message} It is tried again {pause_s:g} s later."
        self._dispatch.move(job, JobEvent.end, reason, losses=losses)

    def _silent_s(self, job: Job, folder: JobFolder, state: ProcessState) -> float:
        """Return the limit that a started worker has broken by not raising its counter; else 0."""
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
        return limit_s if now_s - sign.seen_s > limit_s else 0.0

    def _abandon(self, job: Job, folder: JobFolder, silent_s: float) -> None:
        """Give up a silent worker. It may still be alive: the fence keeps it from publishing."""
        self.kill(job, folder)
        self.part(job, worker_status.VANISHED, f"The worker gave no sign of life for {silent_s:g} s.")

    def kill(self, job: Job, folder: JobFolder) -> None:
        """End a worker for certain: by the engine, and where that fails by taking its lease."""
        with contextlib.suppress(OSError):
            folder.revoke()
        with contextlib.suppress(EngineError):
            if job.handle:
                self._engine.stop(job.handle, kill=True)

    def _enforce_stop(self, job: Job, folder: JobFolder) -> None:
        if job.state is JobState.running or job.handle is None:
            return
        asked_s = self._asked.setdefault((job.id, job.attempt), time.monotonic())
        kill = time.monotonic() - asked_s > self._config.stop_limit_s
        if self._told.get(job.id) == (job.attempt, kill):
            return
        try:
            if kill:
                self.kill(job, folder)
            else:
                self._engine.stop(job.handle)
            self._told[job.id] = (job.attempt, kill)
        except EngineError as error:
            _log.warning("%s", error)


def pause_after(losses: int, config: JobsConfig) -> float:
    """Return how long a job waits after so many losses in a row: twice as long each time, to a limit."""
    # 2^60 first pauses are beyond any limit, and no float overflows.
    return min(config.retry_first_s * 2 ** min(losses - 1, 60), config.retry_longest_s)


def _goodbye(path: Path) -> tuple[int, str] | None:
    """Return the status and the message that a worker left; None when it left none that can be read."""
    try:
        content = read_json(path)
        return (int(content["status"]), str(content["message"])) if content else None
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None


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
