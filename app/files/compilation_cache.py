"""What was compiled once is kept in the user's cache folder: a second solve of the same kind starts at once.

A grid level takes five to twenty seconds to compile and a second to run. Programs hold machine code, so
each kind of processor has its own folder: a home folder may be shared by unlike machines. An entry that another
process is still writing, or that was cut off, fails its checksum and the program is compiled again.
"""

import contextlib
import hashlib
import os
import platform
import sys
import warnings
from pathlib import Path

from app.files.user_folders import cache_folder

LARGEST_BYTES = 1_000_000_000


def use_compilation_cache() -> Path | None:
    """Turn the cache on, unless JAX_COMPILATION_CACHE_DIR says where; None where no folder can be made."""
    # JAX then compiles anew: nothing that the operator has to know.
    warnings.filterwarnings("ignore", "Error reading persistent compilation cache entry")
    if os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return None
    folder = _own_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        prune(folder, LARGEST_BYTES)
    except OSError:
        return None  # A home that cannot be written: everything is compiled anew.
    for name, value in {
        "jax_compilation_cache_dir": str(folder),
        # Small programs too: a solve has some two hundred, and compiles them in a quarter of a draft's time.
        "jax_persistent_cache_min_compile_time_secs": 0,
    }.items():
        os.environ[name.upper()] = str(value)  # read when JAX is imported, which is not done for this
        if "jax" in sys.modules:
            sys.modules["jax"].config.update(name, value)
    return folder


def compiled_folder() -> Path | None:
    """Where programs are kept, by JAX_COMPILATION_CACHE_DIR or by this module; None where nothing is."""
    named = os.environ.get("JAX_COMPILATION_CACHE_DIR")
    folder = Path(named) if named else _own_folder()
    return folder if folder.is_dir() else None


def _own_folder() -> Path:
    return cache_folder() / f"compiled-{_processor()}"


def prune(folder: Path, largest_bytes: int) -> None:
    """Remove the entries that were read longest ago, until the rest is no larger."""
    entries = [(path, path.stat()) for path in folder.iterdir() if path.is_file()]
    entries.sort(key=lambda entry: max(entry[1].st_atime, entry[1].st_mtime), reverse=True)
    total = 0
    for path, found in entries:
        total += found.st_size
        if total > largest_bytes:
            with contextlib.suppress(OSError):  # another process was faster
                path.unlink()


def _processor() -> str:
    """A short hash of what code may be compiled for here."""
    features = ""
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        features = "".join(
            sorted({line for line in lines if line.startswith(("flags", "Features", "model name"))})
        )
    return hashlib.sha256((platform.machine() + features).encode()).hexdigest()[:12]
