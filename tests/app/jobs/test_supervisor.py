"""The supervisor with real workers. A worker costs a second or two to start, so each test tells a story."""

import contextlib
import json
import os
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

from app.jobs import FencedError, Job, JobError, JobsConfig, JobSpec, JobState, Ledger, Supervisor
from app.jobs.attempt import Attempt, publish
from app.jobs.dispatch import Dispatch
from app.jobs.folder import JobFolder, Owner, is_held

QUICK = {"poll_s": 0.05, "retry_first_s": 0.1, "memory_reserve_bytes": 0, "disk_reserve_bytes": 0}


def study(trials: int = 100000, memory_bytes: int = 1 << 28, **settings: float) -> JobSpec:
    return JobSpec(
        kind="noise-study", settings={"trials": trials, "size_px": 64, **settings}, memory_bytes=memory_bytes
    )


class Running:
    """A supervisor in a thread, as `airlens serve` may embed it."""

    def __init__(self, ledger: Ledger, **config) -> None:
        self.stop = threading.Event()
        self.supervisor = Supervisor(ledger, JobsConfig(**{**QUICK, **config}))
        self.thread = threading.Thread(target=self.supervisor.run, args=(self.stop,))

    def __enter__(self) -> Supervisor:
        self.thread.start()
        return self.supervisor

    def __exit__(self, *_: object) -> None:
        self.stop.set()
        self.thread.join()


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    ledger = Ledger(tmp_path / "jobs")
    yield ledger
    for folder in ledger.folder.glob("j*/owner.json"):
        JobFolder(folder.parent).revoke()  # ends also a worker that is only just starting
    for file in ledger.folder.glob("*/attempts/*/worker.json"):
        if is_held(file.with_name("worker.lock")):
            os.kill(json.loads(file.read_text())["pid"], signal.SIGKILL)


def until(condition: Callable[[], object], limit_s: float = 200.0) -> None:
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "it did not come to pass in time"
        time.sleep(0.02)


def until_state(ledger: Ledger, job: Job, state: JobState) -> None:
    until(lambda: ledger.get(job.id).state is state)


def gone(process: psutil.Process) -> bool:
    """Whether it has ended; its entry may wait for the parent a little longer."""
    with contextlib.suppress(psutil.NoSuchProcess):
        return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE
    return True


def until_computing(ledger: Ledger, job: Job) -> None:
    until(lambda: ledger.get(job.id).step > 0 and ledger.get(job.id).state is JobState.running)


def worker(ledger: Ledger, job: Job) -> psutil.Process:
    attempt = JobFolder(ledger.folder_of(job.id)).attempt(ledger.get(job.id).attempt)
    return psutil.Process(json.loads((attempt / "worker.json").read_text())["pid"])


def test_cancel_keeps_a_checkpoint_and_retry_goes_on_from_it(ledger: Ledger):
    job = ledger.submit(study())
    with Running(ledger):
        until_computing(ledger, job)
        process = worker(ledger, job)
        attempt = JobFolder(ledger.folder_of(job.id)).attempt(1)

        assert ledger.cancel(job.id).state is JobState.cancelling
        until_state(ledger, job, JobState.cancelled)

        assert json.loads((attempt / "exit.json").read_text())["status"] == 75
        until(lambda: gone(process))  # how soon: tests/benchmarks/cancel.py
        with np.load(attempt / "checkpoint" / "sums.npz") as sums:
            reached = int(sums["trials"])

        ledger.retry(job.id)
        until(lambda: ledger.get(job.id).step > reached)
        ledger.pause(job.id)
        until_state(ledger, job, JobState.paused)
    assert ledger.get(job.id).attempt == 2
    assert ledger.get(job.id).device is None


def test_a_worker_outlives_its_supervisor_and_the_next_one_adopts_it(ledger: Ledger):
    job = ledger.submit(study())
    with Running(ledger):
        until_computing(ledger, job)
        with pytest.raises(JobError, match="Another supervisor"):
            Supervisor(ledger, JobsConfig()).run(threading.Event())
    process, step = worker(ledger, job), ledger.get(job.id).step
    assert process.is_running()
    with Running(ledger):
        until(lambda: ledger.get(job.id).step > step)
        assert worker(ledger, job) == process
        # A killed worker is started again, and goes on.
        process.kill()
        until(lambda: ledger.get(job.id).attempt == 2)
        until(lambda: ledger.get(job.id).step > step and is_held(_lock(ledger, job, 2)))
    states = [event.body["state"] for event in ledger.events(job=job.id) if event.kind == "state"]
    assert states == ["queued", "running", "lost", "running"]


def test_a_silent_worker_is_replaced_and_can_never_publish(ledger: Ledger):
    job = ledger.submit(study(trials=60))
    slow = ledger.submit(study())
    with Running(ledger, lease_s=1.5):
        until_state(ledger, job, JobState.done)
        until_computing(ledger, slow)
        stopped = worker(ledger, slow)
        stopped.suspend()
        until(lambda: ledger.get(slow.id).attempt == 2)
    folder = JobFolder(ledger.folder_of(slow.id))
    old = Attempt(
        folder=folder, owner=Owner(1, "whatever it was"), experiment=None, output=folder.path / ".late.tmp"
    )
    old.output.mkdir()
    with pytest.raises(FencedError, match="was replaced by a newer one"):
        publish(old, {})
    assert not folder.is_published()


def test_one_job_a_device_by_the_ledger_itself(ledger: Ledger):
    first, second = ledger.submit(study()), ledger.submit(study())
    dispatch = Dispatch(ledger)
    assert dispatch.begin(first.id, "gpu:0", "local") is not None
    assert dispatch.begin(second.id, "gpu:0", "local") is None
    assert dispatch.begin(first.id, "gpu:1", "local") is None
    assert dispatch.begin(second.id, "gpu:1", "local") is not None


def test_a_job_waits_for_memory_and_for_disk_and_says_so(ledger: Ledger):
    greedy = ledger.submit(study(memory_bytes=1 << 60))
    fat = ledger.submit(JobSpec(kind="noise-study", disk_bytes=1 << 60))
    supervisor = Supervisor(ledger, JobsConfig())
    supervisor.round()
    assert ledger.get(greedy.id).reason.startswith("Waiting for memory: 1073741824.50 GiB needed")
    assert ledger.get(fat.id).reason.startswith("Waiting for disk space: 1073741824.12 GiB needed")
    assert {job.state for job in ledger.jobs()} == {JobState.queued}


def test_a_failure_is_told_in_words_and_not_tried_again(ledger: Ledger):
    job = ledger.submit(study(trials=10))
    order = ledger.folder_of(job.id) / "job.json"
    order.write_text(order.read_text().replace('"trials": 10', '"trials": -10'))
    with Running(ledger):
        until_state(ledger, job, JobState.failed)
    assert "greater than or equal to 1" in ledger.get(job.id).reason


def test_a_job_whose_folder_was_deleted_fails_and_the_others_go_on(ledger: Ledger):
    gone, greedy = ledger.submit(study()), ledger.submit(study(memory_bytes=1 << 60))
    shutil.rmtree(ledger.folder_of(gone.id))
    Supervisor(ledger, JobsConfig()).round()
    assert ledger.get(gone.id).state is JobState.failed
    assert "is gone" in ledger.get(gone.id).reason
    assert ledger.get(greedy.id).reason.startswith("Waiting for memory")


def _lock(ledger: Ledger, job: Job, attempt: int) -> Path:
    return JobFolder(ledger.folder_of(job.id)).attempt(attempt) / "worker.lock"
