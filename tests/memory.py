"""What a run of tests holds in memory: what is compiled is given back after each module.

A compiled program lives as long as the process, and a run compiles thousands. They are kept on disk for the
run, so that the next module, or another worker, that needs the same one reads it.

Most of a run of tests is compiling. So programs are not optimised, which saves a sixth to a third of a module's time,
and XLA's older emitters of the CPU write them, in two thirds of the newer ones' time. A user's run optimises:
`XLA_FLAGS=--xla_backend_optimization_level=3 make test` does that too.
`pytest --memory-table FILE` writes a line a module: resident MB before and after giving back, and CPU seconds.
"""

import ctypes
import gc
import os
import shutil
import tempfile
from pathlib import Path

import jax
import psutil
import pytest

_FOLDER = "JAX_COMPILATION_CACHE_DIR"
_MACHINE = "AIRLENS_MACHINE"
_EMITTERS = "--xla_cpu_use_fusion_emitters"
_OPTIMISED = "--xla_backend_optimization_level"


def pytest_configure(config) -> None:
    # Set where the run begins: workers and the processes that tests start inherit it.
    if hasattr(config, "workerinput"):
        return
    # XLA reads its flags when the first program is compiled, which is after this.
    flags = os.environ.get("XLA_FLAGS", "")
    if _OPTIMISED not in flags:
        flags += f" {_OPTIMISED}=0"
    # The XLA of JAX 0.11 has the newer ones alone, and ends a process that names the switch.
    if _EMITTERS not in flags and jax.__version_info__ < (0, 11):
        flags += f" {_EMITTERS}=false"
    os.environ["XLA_FLAGS"] = flags.strip()
    if not os.environ.get(_MACHINE):
        # Runs of tests say nothing of this machine's speed to whoever uses it.
        runs = tempfile.mkdtemp(prefix="airlens-machine-")
        config.add_cleanup(lambda: shutil.rmtree(runs, ignore_errors=True))
        os.environ[_MACHINE] = str(Path(runs) / "machine.json")
    if os.environ.get(_FOLDER):
        return
    folder = tempfile.mkdtemp(prefix="airlens-compiled-")
    config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
    os.environ[_FOLDER] = folder
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


@pytest.fixture(scope="module", autouse=True)
def compiled_programs(request):
    """Give back what a module compiled, and the memory that it took, to the system."""
    yield
    before_mb = _resident_mb()
    jax.clear_caches()
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:  # glibc
        trim(0)
    table = request.config.getoption("--memory-table")
    if table:
        spent = psutil.Process().cpu_times()
        line = f"{request.module.__name__} {before_mb:.0f} {_resident_mb():.0f} {spent.user + spent.system:.0f}\n"
        with Path(table).open("a", encoding="utf-8") as file:
            file.write(line)


def _resident_mb() -> float:
    return psutil.Process().memory_info().rss / 1e6
