"""Whether a job may start now: enough free memory and disk, beyond what running jobs may still take."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import psutil

from app.jobs.config import GIB, JobsConfig
from app.jobs.engines.local import LocalEngine
from app.jobs.records import Job


def disk_shortage(job: Job, folder: Path, config: JobsConfig) -> str:
    """Return why the job must wait for disk space, or an empty string."""
    need_bytes = job.disk_bytes + config.disk_reserve_bytes
    for place in (folder, job.experiment):
        free_bytes = shutil.disk_usage(place).free if place is not None and place.exists() else need_bytes
        if free_bytes < need_bytes:
            return (
                f"Waiting for disk space: {_gib(need_bytes)} needed at {place}, {_gib(free_bytes)} free. "
                "Delete old results or move the folder; the job then starts by itself."
            )
    return ""


def memory_shortage(job: Job, running: Sequence[Job], engine: LocalEngine, config: JobsConfig) -> str:
    """Return why the job must wait for memory, or an empty string."""
    promised_bytes = sum(
        max(0, other.memory_bytes - engine.memory_bytes(other.handle)) for other in running if other.handle
    )
    free_bytes = psutil.virtual_memory().available - promised_bytes
    need_bytes = job.memory_bytes + config.memory_reserve_bytes
    if free_bytes >= need_bytes:
        return ""
    return (
        f"Waiting for memory: {_gib(need_bytes)} needed, {_gib(free_bytes)} free. It starts by itself "
        "when other jobs or programs end; or choose a smaller grid."
    )


def _gib(count_bytes: float) -> str:
    return f"{max(0.0, count_bytes) / GIB:.2f} GiB"
