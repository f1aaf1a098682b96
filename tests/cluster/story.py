"""What every cluster engine must do, told once: the same job, the same bits, a cancel, a lost node."""

import contextlib
import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil

from app import worker
from app.jobs import Job, JobsConfig, JobSpec, JobState, Ledger, Supervisor
from app.jobs.folder import JobFolder, Owner


def study(trials: int) -> JobSpec:
    return JobSpec(kind="noise-study", settings={"trials": trials, "size_px": 64}, memory_bytes=1 << 29)


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@contextlib.contextmanager
def supervised(ledger: Ledger, config: JobsConfig) -> Iterator[None]:
    stop = threading.Event()
    thread = threading.Thread(target=Supervisor(ledger, config).run, args=(stop,))
    thread.start()
    try:
        yield
    finally:
        for job in ledger.jobs(states=(JobState.running,)):
            ledger.cancel(job.id)
        until(lambda: not any(job.state.is_active for job in ledger.jobs()), 60)
        stop.set()
        thread.join()


def until(condition: Callable[[], object], limit_s: float) -> None:
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "it did not come to pass in time"
        time.sleep(0.1)


def until_state(ledger: Ledger, job: Job, state: JobState, limit_s: float = 120) -> None:
    until(lambda: ledger.get(job.id).state is state, limit_s)


def check_same_bits(folder: Path, config: JobsConfig) -> None:
    ledger = Ledger(folder / "engine")
    with supervised(ledger, config):
        job = ledger.submit(study(trials=40))
        until_state(ledger, job, JobState.done)
    alone = JobFolder(Ledger(folder / "alone").folder_of(Ledger(folder / "alone").submit(study(40)).id))
    owner = Owner(1, "alone")
    alone.hand_over(owner)
    worker.compute(alone, owner, threading.Event())
    assert files_of(ledger.folder_of(job.id) / "result") == files_of(alone.path / "result")


def check_cancel(folder: Path, config: JobsConfig) -> None:
    ledger = Ledger(folder / "cancel")
    with supervised(ledger, config):
        job = ledger.submit(study(trials=1_000_000))
        until(lambda: ledger.get(job.id).step > 0, 120)
        attempt = JobFolder(ledger.folder_of(job.id)).attempt(1)
        process = process_of(attempt)
        asked_s = time.time()
        ledger.cancel(job.id)
        until(lambda: (attempt / "exit.json").exists(), 15)
        checkpoint_s = (attempt / "checkpoint" / "sums.npz").stat().st_mtime - asked_s
        until(lambda: not process.is_running() or process.status() == psutil.STATUS_ZOMBIE, 15)
        gone_s = time.time() - asked_s
        until_state(ledger, job, JobState.cancelled)
    print(json.dumps({"engine": config.engine, "checkpoint_s": checkpoint_s, "gone_s": gone_s}))
    assert json.loads((attempt / "exit.json").read_text())["status"] == 75
    # The allowance of the contract: checkpoint within 2 s, process gone within 15 s.
    assert checkpoint_s < 2
    assert gone_s < 15


def check_lost_node(folder: Path, config: JobsConfig, kill_node: Callable[[psutil.Process], None]) -> None:
    ledger = Ledger(folder / "lost")
    with supervised(ledger, config):
        job = ledger.submit(study(trials=1_000_000))
        until(lambda: ledger.get(job.id).step > 0, 120)
        job_folder = JobFolder(ledger.folder_of(job.id))
        old, step = process_of(job_folder.attempt(1)), ledger.get(job.id).step
        start_s = time.monotonic()
        kill_node(old)
        survived = old.is_running() and old.status() != psutil.STATUS_ZOMBIE
        until(lambda: ledger.get(job.id).attempt > 1 and ledger.get(job.id).step > step, 90)
        again_s = time.monotonic() - start_s
        # Where only the node's daemon died, the fence ends the worker that lived on.
        until(lambda: not old.is_running() or old.status() == psutil.STATUS_ZOMBIE, 15)
        late = (job_folder.attempt(1) / "checkpoint" / "sums.npz").stat().st_mtime
        attempts = ledger.get(job.id).attempt
    record = {"engine": config.engine, "running_again_s": again_s, "old_worker_survived": survived}
    print(json.dumps(record | {"attempts": attempts, "old_checkpoint_age_s": time.time() - late}))
    assert again_s < 45
    assert not job_folder.is_published()


def process_of(attempt: Path) -> psutil.Process:
    return psutil.Process(json.loads((attempt / "worker.json").read_text())["pid"])
