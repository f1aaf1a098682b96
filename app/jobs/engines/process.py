"""Which process a number means: numbers are given again, and the wall clock may be set."""

import contextlib
from pathlib import Path

import psutil

_START_FIELD = 19  # of those after the name, in /proc/PID/stat


def started(pid: int) -> str:
    """Return when a process began: boot and ticks since, by no clock that can be set; "" when it is gone."""
    with contextlib.suppress(OSError, IndexError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        # The name is in brackets, and may hold anything.
        fields = Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()
        return f"{boot[:8]}-{fields[_START_FIELD].decode()}"
    with contextlib.suppress(psutil.NoSuchProcess):
        # Elsewhere than on Linux, the system's own word.
        return str(psutil.Process(pid).create_time())
    return ""
