"""A supervisor beside the service: a process of its own, started again when it ends, gone with its owner."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from app.jobs.waiting import SUPERVISOR_LOG

_PAUSE_S = 2.0


@contextlib.contextmanager
def attended(folder: Path) -> Iterator[None]:
    """Keep the jobs in `folder` supervised while the block runs; workers outlive it.

    Where another supervisor already has the folder, this one waits to take over. Its log is the folder's
    `supervisor.log`.
    """
    stop = threading.Event()
    folder.mkdir(parents=True, exist_ok=True)
    thread = threading.Thread(target=_attend, args=(folder, stop), name="supervisor")
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def stop_with_parent(stop: threading.Event) -> None:
    """Set `stop` when this process has lost its parent, however that ended."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        stop.set()

    threading.Thread(target=watch, daemon=True).start()


def _attend(folder: Path, stop: threading.Event) -> None:
    command = [sys.executable, "-P", "-m", "app.jobs", str(folder), "--with-parent"]
    variables = {name: value for name, value in os.environ.items() if "TOKEN" not in name}
    while not stop.is_set():
        with open(folder / SUPERVISOR_LOG, "ab") as log:
            streams = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": log}
            child = subprocess.Popen(command, env=variables, start_new_session=True, **streams)
        while child.poll() is None and not stop.wait(0.2):
            pass
        if child.poll() is None:
            child.send_signal(signal.SIGTERM)
        child.wait()
        stop.wait(_PAUSE_S)
