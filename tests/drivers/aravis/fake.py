"""Aravis's own fake GigE Vision camera: a process on this machine's loopback."""

import fcntl
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from drivers.aravis import AravisCamera, AravisRequest, is_installed
from drivers.errors import DeviceNotFoundError

ADDRESS = "127.0.0.1"
# The fake answers at one port of the machine: tests that run side by side take turns.
TURN = Path(tempfile.gettempdir()) / f"airlens-fake-camera-{os.getuid()}.lock"
PROGRAM = next((p for p in ("arv-fake-gv-camera-0.8", "arv-fake-gv-camera-0.10") if shutil.which(p)), None)
# At this exposure the fake's ramp has one count a pixel.
REQUEST = AravisRequest(ADDRESS, 256, 128, frame_rate_hz=100.0, exposure_s=0.01)
missing = pytest.mark.skipif(
    not is_installed() or PROGRAM is None,
    reason="Aravis or its fake camera is not installed; on Debian: apt install libaravis-0.8-0 aravis-tools",
)


@contextmanager
def no_camera() -> Iterator[None]:
    """Nothing answers at ADDRESS: whoever else would start a camera waits."""
    with TURN.open("w") as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        yield


@contextmanager
def fake_camera(*options: str) -> Iterator[subprocess.Popen]:
    """A camera that answers at ADDRESS, the only one on this machine."""
    with no_camera():
        process = subprocess.Popen([str(PROGRAM), "-i", ADDRESS, *options], stdout=subprocess.DEVNULL)
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def opened(request: AravisRequest = REQUEST, within_s: float = 30.0) -> AravisCamera:
    """The camera, once the process answers."""
    until_s = time.monotonic() + within_s
    while True:
        try:
            return AravisCamera(request)
        except DeviceNotFoundError:
            if time.monotonic() > until_s:
                raise
            time.sleep(0.1)
