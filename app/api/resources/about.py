"""Is it alive, and what is it."""

import importlib.metadata
import os
import platform
import shutil

import psutil
from fastapi import APIRouter

from app.api.models.about import About, Health
from app.api.services import Given

router = APIRouter(tags=["about"])


def version() -> str:
    """Return the installed version."""
    return importlib.metadata.version("airlens")


@router.get("/health")
async def read_health(given: Given) -> Health:
    """Say whether the service answers and how much room it has."""
    free_bytes = shutil.disk_usage(given.config.data_root).free
    return Health(
        status="ok" if free_bytes > 1 << 30 else "disk_low",
        free_disk_bytes=free_bytes,
        free_memory_bytes=psutil.virtual_memory().available,
        load_per_core=os.getloadavg()[0] / (os.cpu_count() or 1),
    )


@router.get("/about")
def read_about(given: Given) -> About:
    """Say what this is and where its data are."""
    return About(
        name="airlens",
        version=version(),
        python=platform.python_version(),
        machine=platform.machine(),
        cores=os.cpu_count() or 1,
        data_root=str(given.config.data_root),
    )
