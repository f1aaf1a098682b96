import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from app.jobs import attended
from app.jobs.folder import is_held

OWNER = """
import pathlib, sys, time
from app.jobs import attended
with attended(pathlib.Path(sys.argv[1])):
    time.sleep(100)
"""


def until(condition: Callable[[], bool], limit_s: float = 200.0) -> None:
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "it did not come to pass in time"
        time.sleep(0.05)


def test_the_supervisor_ends_with_its_owner_however_that_ends_and_the_next_takes_over(tmp_path: Path):
    lock, log = tmp_path / "supervisor.lock", tmp_path / "supervisor.log"
    owner = subprocess.Popen([sys.executable, "-c", OWNER, str(tmp_path)])
    until(lambda: is_held(lock))
    with attended(tmp_path):
        until(lambda: "Another supervisor" in log.read_text())
        owner.kill()
        owner.wait()
        until(lambda: not is_held(lock))
        until(lambda: is_held(lock))
    assert not is_held(lock)
