"""The local engine: one subprocess a device, no set-up. It outlives the supervisor, which adopts it again."""

import contextlib
import os
import signal
import sys

import psutil

from app.jobs.engines.engine import Launch, ProcessState
from app.jobs.engines.process import started
from app.jobs.errors import EngineError
from app.jobs.folder import JobFolder, read_json


class LocalEngine:
    """Workers as child processes in sessions of their own. The handle is `pid:start time`."""

    name = "local"

    def __init__(self) -> None:
        self._children: set[int] = set()
        self._ended: dict[int, int] = {}

    def probe(self) -> None:
        """Nothing to check: the machine is here."""

    def start(self, launch: Launch) -> str:
        """Start the worker. Raises EngineError when the system refuses."""
        self._reap()
        log = str(JobFolder(launch.folder).attempt(launch.attempt) / "log.txt")
        try:
            pid = os.posix_spawn(
                sys.executable,
                [sys.executable, *launch.worker_arguments],
                _environment(launch.device),
                file_actions=[
                    (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
                    (os.POSIX_SPAWN_OPEN, 1, log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644),
                    (os.POSIX_SPAWN_DUP2, 1, 2),
                ],
                setsid=True,
                setsigmask=(),
                setsigdef=(signal.SIGINT, signal.SIGTERM),
            )
        except OSError as error:
            raise EngineError(
                f"The worker could not be started: {error}. Free memory or disk space."
            ) from error
        self._children.add(pid)
        return f"{pid}:{started(pid)}"

    def find(self, launch: Launch) -> str | None:
        """Return the handle that the worker left in its folder."""
        try:
            content = read_json(JobFolder(launch.folder).attempt(launch.attempt) / "worker.json")
            return f"{content['pid']}:{content['started']}" if content else None
        except (ValueError, KeyError, TypeError):
            return None  # a damaged file names no process

    def state(self, handle: str) -> ProcessState:
        """Say whether that very process lives; another one with the same number does not count."""
        self._reap()
        return ProcessState.gone if _process(handle) is None else ProcessState.running

    def exit_status(self, handle: str) -> int | None:
        """Return the exit status of a child; that of an adopted worker is not known."""
        return self._ended.get(int(handle.partition(":")[0]))

    def stop(self, handle: str, *, kill: bool = False) -> None:
        """Signal the worker: SIGTERM to itself, SIGKILL to its whole session."""
        process = _process(handle)
        with contextlib.suppress(ProcessLookupError, psutil.NoSuchProcess):
            if process is not None and kill:
                os.killpg(process.pid, signal.SIGKILL)
            elif process is not None:
                process.terminate()

    def close(self) -> None:
        """Nothing to give back."""

    def memory_bytes(self, handle: str) -> int:
        """Return the resident memory of the worker, 0 when it is gone."""
        process = _process(handle)
        with contextlib.suppress(psutil.NoSuchProcess):
            return process.memory_info().rss if process else 0
        return 0

    def _reap(self) -> None:
        """Collect the children that ended; those that this process adopted are init's to collect."""
        for pid in list(self._children):
            with contextlib.suppress(ChildProcessError):
                found, status = os.waitpid(pid, os.WNOHANG)
                if found == 0:
                    continue
                self._ended[pid] = os.waitstatus_to_exitcode(status)
            self._children.discard(pid)


def _environment(device: str) -> dict[str, str]:
    """Return the worker's environment: its device, and no token of the service."""
    variables = {name: value for name, value in os.environ.items() if "TOKEN" not in name}
    kind, _, index = device.partition(":")
    variables["JAX_PLATFORMS"] = "cpu" if kind == "cpu" else variables.get("JAX_PLATFORMS", "")
    if kind == "gpu":
        variables["CUDA_VISIBLE_DEVICES"] = index or "0"
    return variables


def _process(handle: str) -> psutil.Process | None:
    pid, _, began = handle.partition(":")
    try:
        process = psutil.Process(int(pid))
        is_same = started(process.pid) == began
        return process if is_same and process.status() != psutil.STATUS_ZOMBIE else None
    except psutil.NoSuchProcess:
        return None
