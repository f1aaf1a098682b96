"""`python -m app.worker JOBDIR`: run one attempt at one job. Every engine runs this same command.

SIGTERM: write a checkpoint, exit 75. Exit status: 0 done, 1 failed, 74 no space, 75 stopped and
resumable, 76 fenced (a newer attempt owns the job), 77 another process already runs this attempt.
"""

import argparse
import errno
import os
import shutil
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from app.errors import AirlensError
from app.files.compilation_cache import use_compilation_cache
from app.files.durable import make_folder, write_json
from app.jobs import kinds
from app.jobs.attempt import Attempt, AttemptStoppedError, inherit_checkpoint, publish
from app.jobs.engines.process import started
from app.jobs.errors import FencedError
from app.jobs.folder import JobFolder, Owner, beat, try_lock
from app.jobs.worker_status import DONE, FAILED, FENCED, NO_SPACE, STOPPED, TAKEN

# How long a computation has to hear of a stop and keep what it has.
_STOP_S = 3.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the worker; return its exit status."""
    parser = argparse.ArgumentParser(prog="app.worker", description="Run one job.")
    parser.add_argument("folder", type=Path, help="the job's folder")
    parser.add_argument("--attempt", type=int, default=None, help="refuse to run unless this attempt owns it")
    parser.add_argument(
        "--lease-s", type=float, default=15.0, help="stop when the lease was not renewed so long"
    )
    options = parser.parse_args(arguments)
    stop = threading.Event()
    hear(stop)
    folder = JobFolder(options.folder.resolve())
    owner = folder.owner()
    if options.attempt not in (None, owner.attempt):
        return FENCED
    lock = try_lock(folder.attempt(owner.attempt) / "worker.lock", wait_s=1.0)
    if lock is None:
        return TAKEN
    with lock:
        try:
            _introduce(folder, owner)
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                raise
            # No room even for the worker's own name: its exit status says so.
            return NO_SPACE
        threading.Thread(target=_renew, args=(folder, owner, options.lease_s), daemon=True).start()
        threading.Thread(target=_end_soon, args=(folder, owner, stop), daemon=True).start()
        return _attempt(folder, owner, stop)


def hear(stop: threading.Event) -> None:
    """Set `stop` at SIGTERM and SIGINT: at once, also while the main thread is in one long call, as in a compilation.

    Python calls a handler only between two steps of the main thread; the system writes to a socket at once.
    """
    hearing, told = socket.socketpair()
    told.setblocking(False)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    signal.set_wakeup_fd(told.detach(), warn_on_full_buffer=False)

    def listen() -> None:
        hearing.recv(1)
        stop.set()

    threading.Thread(target=listen, daemon=True).start()


def _attempt(folder: JobFolder, owner: Owner, stop: threading.Event) -> int:
    status, message = FAILED, ""
    use_compilation_cache()
    try:
        compute(folder, owner, stop)
        status = DONE
    except AttemptStoppedError:
        status = STOPPED
    except FencedError as error:
        status, message = FENCED, str(error)
    except OSError as error:
        status = NO_SPACE if error.errno in (errno.ENOSPC, errno.EDQUOT) else FAILED
        message = f"{error.strerror}: {error.filename}. Nothing half-written was kept."
    except MemoryError as error:
        message = f"Not enough memory: {error}. Choose a smaller grid or batch, or a larger machine."
    except Exception as error:
        message = _explain(error)
    if status != FENCED:
        _say_goodbye(folder, owner, status, message)
    return status


def _explain(error: Exception) -> str:
    """Return what the operator should read: a foreseen error says it itself, any other is a defect."""
    # Imported here: the array library behind it is not needed before the computation begins.
    from core.setting import SettingError

    if isinstance(error, AirlensError | SettingError):
        return str(error)
    traceback.print_exception(error)
    return f"{type(error).__name__}: {error}. This is a defect; log.txt of the attempt has the trace."


def compute(folder: JobFolder, owner: Owner, stop: threading.Event) -> None:
    """Run the computation from its last checkpoint and publish the result.

    Raises AttemptStoppedError, FencedError, and whatever the computation raises.
    """
    order = folder.order()
    kind = kinds.load(order["kind"])
    settings = kind.read(order["settings"])
    staging = folder.staging(owner.attempt)
    # The name that it will have: a report may show it.
    output = staging / folder.target().name
    inherit_checkpoint(folder, owner.attempt)
    shutil.rmtree(staging, ignore_errors=True)
    make_folder(output)
    experiment = Path(order["experiment"]) if order["experiment"] else None
    attempt = Attempt(folder=folder, owner=owner, experiment=experiment, output=output, stop=stop)
    try:
        publish(attempt, kind.run(attempt, settings))
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _introduce(folder: JobFolder, owner: Owner) -> None:
    content = {"pid": os.getpid(), "started": started(os.getpid()), "host": socket.gethostname()}
    write_json(folder.attempt(owner.attempt) / "worker.json", content)


def _say_goodbye(folder: JobFolder, owner: Owner, status: int, message: str) -> None:
    """Leave exit.json; on a full disk there may be no room even for that: then the process just ends."""
    content = {"status": status, "message": message}
    try:
        write_json(folder.attempt(owner.attempt) / "exit.json", content)
    except OSError as error:
        print(f"{message} (exit.json could not be written: {error})", file=sys.stderr)


def _end_soon(folder: JobFolder, owner: Owner, stop: threading.Event) -> None:
    """End the process where the computation does not hear of a stop: nothing interrupts a compilation.

    What it has kept so far is whole, and the next attempt goes on from that.
    """
    stop.wait()
    time.sleep(_STOP_S)
    _say_goodbye(folder, owner, STOPPED, "")
    os._exit(STOPPED)


def _renew(folder: JobFolder, owner: Owner, lease_s: float) -> None:
    """Renew the lease; end the process when a newer attempt owns the job or the folder is out of reach."""
    count, failures = 0, 0
    pause = threading.Event()
    while True:
        try:
            folder.check(owner)
            beat(folder.attempt(owner.attempt) / "heartbeat", count)
            count, failures = count + 1, 0
        except FencedError:
            os._exit(FENCED)
        except OSError as error:
            # A full disk is no lost lease: the counter overwrites itself in place.
            failures += error.errno not in (errno.ENOSPC, errno.EDQUOT)
        if failures >= 8:
            os._exit(FENCED)
        pause.wait(lease_s / 8)


def end(status: int) -> NoReturn:
    """End the process now: everything is on disk, and taking the array library apart would take seconds."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    end(main())
