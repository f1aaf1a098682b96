"""Whether a job may start: the free memory of this machine, less what running jobs may still take."""

import os
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from app.jobs import Job, JobsConfig, JobSpec, Ledger
from app.jobs.admission import memory_shortage
from app.jobs.engines.local import LocalEngine
from app.jobs.engines.process import started

# Other programs take and give back memory meanwhile: what is asked for lies far from what is free.
FREE_BYTES = psutil.virtual_memory().available
NO_RESERVE = JobsConfig(memory_reserve_bytes=0)


@pytest.fixture
def engine() -> LocalEngine:
    return LocalEngine()


@pytest.fixture
def job(tmp_path: Path) -> Job:
    order = JobSpec(kind="noise-study", settings={"trials": 8, "size_px": 64}, memory_bytes=FREE_BYTES // 2)
    return Ledger(tmp_path / "jobs").submit(order)


def running(job: Job, promised_bytes: int) -> Job:
    """A job that this very process computes, and that may take so much."""
    return replace(job, handle=f"{os.getpid()}:{started(os.getpid())}", memory_bytes=promised_bytes)


def test_a_job_starts_where_its_memory_is_free_and_waits_where_it_is_not(job: Job, engine: LocalEngine):
    assert memory_shortage(job, [], engine, NO_RESERVE) == ""
    lack = memory_shortage(replace(job, memory_bytes=2 * FREE_BYTES), [], engine, NO_RESERVE)
    assert f"{2 * FREE_BYTES / (1 << 30):.2f} GiB needed" in lack


def test_what_a_running_job_has_not_taken_yet_is_not_free(job: Job, engine: LocalEngine):
    still_to_come = psutil.Process().memory_info().rss + 3 * FREE_BYTES // 4
    assert "Waiting for memory" in memory_shortage(job, [running(job, still_to_come)], engine, NO_RESERVE)


def test_what_a_running_job_has_taken_is_not_counted_twice(job: Job, engine: LocalEngine):
    held_bytes = psutil.Process().memory_info().rss
    taken = running(job, held_bytes // 2)
    many = [taken] * (2 * FREE_BYTES // held_bytes + 1)
    assert memory_shortage(job, many, engine, NO_RESERVE) == ""
    # Nor is what it took beyond its promise given to another job.
    greedy = replace(job, memory_bytes=5 * FREE_BYTES // 4)
    assert "Waiting for memory" in memory_shortage(greedy, many, engine, NO_RESERVE)
    # A job that has not begun has no process to ask, and holds nothing.
    waiting = replace(taken, handle=None, memory_bytes=4 * FREE_BYTES)
    assert memory_shortage(job, [waiting], engine, NO_RESERVE) == ""


def test_a_part_of_the_memory_is_kept_for_other_programs(job: Job, engine: LocalEngine):
    reserve = JobsConfig(memory_reserve_bytes=3 * FREE_BYTES // 4)
    assert "Waiting for memory" in memory_shortage(job, [], engine, reserve)
