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

from app.errors import AirlensError
from app.jobs import worker_status
from app.jobs.admission import disk_shortage, memory_shortage
from app.jobs.config import JobsConfig
from app.jobs.dispatch import Dispatch
from app.jobs.engines import create_engine
from app.jobs.engines.engine import Engine
from app.jobs.engines.local import LocalEngine
from app.jobs.errors import EngineError, JobError
from app.jobs.folder import JobFolder, is_held, try_lock
from app.jobs.ledger import Ledger
from app.jobs.records import Job
from app.jobs.state import JobEvent, JobState
from app.jobs.study import MOST_JOBS, keep_summary
from app.jobs.troubles import FULL, Troubles
from app.jobs.waiting import SUPERVISOR_LOCK
from app.jobs.watch import JobWatch, launch_of, pause_after

_log = logging.getLogger(__name__)


class Supervisor:
    """Runs the queue of one ledger. A second one for the same folder is refused."""

    def __init__(self, ledger: Ledger, config: JobsConfig, engine: Engine | None = None) -> None:
        self._ledger = ledger
        self._config = config
        self._engine = create_engine(config) if engine is None else engine
        self._dispatch = Dispatch(ledger)
        self._watch = JobWatch(self._dispatch, self._engine, config, ledger.folder)
        self._troubles = Troubles(self._dispatch, config.start_limit_s, self._kill)
        self._due_s: dict[tuple[str, int], float] = {}

    def run(self, stop: threading.Event) -> None:
        """Work until `stop` is set; running jobs go on and are adopted by the next supervisor.

        Raises JobError when another supervisor has this folder, EngineError when the engine is not safe.
        """
        with self._only_one(), contextlib.closing(self._engine):
            self._engine.probe()
            while not stop.is_set():
                try:
                    trouble = self.round()
                except Exception as error:
                    # The ledger on a full disk, most likely: nothing was half done, the next round goes on.
                    trouble = str(error)
                    _log.error("%s", error, exc_info=not isinstance(error, AirlensError | OSError))
                stop.wait((10 if trouble else 1) * self._config.poll_s)

    def round(self) -> str:
        """Look at every active job once, then start what fits; return the trouble that was met, if any.

        Each job is looked at alone: whatever it raises, the others have their turn.
        """
        self._troubles.met = ""
        for job in self._dispatch.active():
            self._troubles.alone(job, self._look_at)
        self._fill()
        return self._troubles.met

    def _look_at(self, job: Job) -> bool:
        if self._has_folder(job):
            if job.reason:
                self._dispatch.explain(job, "")  # a trouble that has passed
            self._watch.judge(job)
            if job.group and not self._ledger.get(job.id).state.is_active:
                self._sum_up(job.group)
        return True

    def _kill(self, job: Job) -> None:
        self._watch.kill(job, JobFolder(self._ledger.folder / job.id))

    def _sum_up(self, group: str) -> None:
        """Keep the summary of a group whose last job has ended."""
        if all(job.state.is_finished for job in self._ledger.jobs(group=group, limit=MOST_JOBS)):
            keep_summary(self._ledger, group)

    def _has_folder(self, job: Job) -> bool:
        """True unless somebody deleted the job's folder: then it has failed, and the others go on."""
        folder = self._ledger.folder / job.id
        if (folder / "job.json").is_file():
            return True
        reason = f"Its folder {folder} is gone. Restore it from a copy and `retry`, or submit it again."
        self._dispatch.move(job, JobEvent.fail, reason)
        return False

    @contextlib.contextmanager
    def _only_one(self) -> Iterator[None]:
        lock = try_lock(self._ledger.folder / SUPERVISOR_LOCK, wait_s=1.0)
        if lock is None:
            raise JobError(
                f"Another supervisor already runs the jobs in {self._ledger.folder}. "
                "One is enough: submit to it, or stop it first."
            )
        with lock:
            yield

    def _fill(self) -> None:
        taken = {job.device for job in self._dispatch.active()}
        free = [device for device in self._config.devices if device not in taken]
        waiting = self._dispatch.waiting()
        known = {(job.id, job.attempt) for job in waiting}
        self._due_s = {seen: due_s for seen, due_s in self._due_s.items() if seen in known}
        for job in filter(self._is_due, waiting):
            if not free:
                return
            if self._troubles.alone(job, lambda job: self._try(job, free[0])):
                free.pop(0)

    def _is_due(self, job: Job) -> bool:
        """True when a lost job's pause is over, measured from when this supervisor first saw it lost."""
        if job.state is not JobState.lost:
            return True
        seen = (job.id, job.attempt)
        due_s = self._due_s.setdefault(seen, time.monotonic() + pause_after(job.losses, self._config))
        return time.monotonic() >= due_s

    def _try(self, job: Job, device: str) -> bool:
        """Start the job unless something is lacking; return whether it has taken the device."""
        if not self._has_folder(job):
            return False
        lack = self._lack_of(job)
        if lack or job.state is JobState.queued:
            self._dispatch.explain(job, lack)
        return not lack and self._start(job, device)

    def _lack_of(self, job: Job) -> str:
        """Return why the job cannot start now, or an empty string."""
        folder = JobFolder(self._ledger.folder / job.id)
        lack = disk_shortage(job, folder.path, self._config)
        if lack or not isinstance(self._engine, LocalEngine):
            return lack
        if job.attempt and is_held(folder.attempt(job.attempt) / "worker.lock"):
            # Started by a supervisor that was killed before it could note it. It has no result to lose
            # but the time since its checkpoint; two on one device would cost more.
            handle = self._engine.find(launch_of(job, self._ledger.folder, self._config))
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
                self._dispatch.move(begun, JobEvent.finish)
                return False
            handle = self._engine.start(launch_of(begun, self._ledger.folder, self._config))
        except (EngineError, OSError) as error:
            full = isinstance(error, OSError) and error.errno in FULL
            status = worker_status.NO_SPACE if full else worker_status.VANISHED
            self._watch.part(begun, status, f"{error}.")
            return False
        self._dispatch.record_handle(job.id, owner.attempt, handle)
        return True
