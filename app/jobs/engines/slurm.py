"""SLURM by its command line. Stopping sends SIGTERM to the worker itself; a retry is a new submission."""

import shlex
import subprocess

from app.jobs.config import SlurmConfig
from app.jobs.engines.engine import Launch, ProcessState
from app.jobs.errors import EngineError
from app.jobs.folder import JobFolder

_PENDING = {"PENDING", "CONFIGURING", "REQUEUED", "SUSPENDED", "RESV_DEL_HOLD", "REQUEUE_HOLD"}
_TIMEOUT_S = 20.0
_MIB = 1 << 20


class SlurmEngine:
    """Batch jobs of the cluster that `sbatch` on this machine talks to. The handle is the job number."""

    name = "slurm"

    def __init__(self, config: SlurmConfig) -> None:
        self._config = config

    def probe(self) -> None:
        """Raise EngineError unless the controller answers."""
        self._run("squeue", "--noheader", "--me")

    def start(self, launch: Launch) -> str:
        """Submit the worker as a batch job; return its number."""
        folder = JobFolder(launch.folder).attempt(launch.attempt)
        worker = shlex.join([self._config.python, *launch.worker_arguments])
        options = [
            "--parsable",
            "--no-requeue",
            f"--job-name={launch.name}",
            f"--chdir={launch.folder}",
            f"--output={folder / 'log.txt'}",
            "--open-mode=append",
            f"--cpus-per-task={self._config.cpus_per_job}",
            f"--mem={max(1, launch.memory_bytes // _MIB)}M",
            # Only what is named: the service's environment is not the worker's.
            "--export=PATH,HOME,JAX_PLATFORMS",
            *([f"--partition={self._config.partition}"] if self._config.partition else []),
            *([f"--time={self._config.time_limit}"] if self._config.time_limit else []),
            *([f"--gpus={self._config.gpus_per_job}"] if self._config.gpus_per_job else []),
        ]
        # `exec`: the signal then reaches the worker, not a shell around it.
        answer = self._run("sbatch", *options, f"--wrap=exec {worker}")
        return answer.strip().split(";")[0]

    def find(self, launch: Launch) -> str | None:
        """Return the number of the job with the attempt's name, while SLURM still knows it."""
        found = self._run("squeue", "--noheader", "--states=all", f"--name={launch.name}", "--format=%i")
        return found.split()[0] if found.split() else None

    def state(self, handle: str) -> ProcessState:
        """Ask the controller; a job that it has forgotten is gone."""
        # By user and not by number: an unknown number is an error that looks like any other.
        lines = self._run("squeue", "--noheader", "--me", "--format=%i %T").splitlines()
        states = dict(line.split(maxsplit=1) for line in lines)
        if handle not in states:
            return ProcessState.gone
        return ProcessState.pending if states[handle] in _PENDING else ProcessState.running

    def exit_status(self, handle: str) -> int | None:
        """Not known without SLURM's accounting; the worker's own word in exit.json is enough."""
        return None

    def stop(self, handle: str, *, kill: bool = False) -> None:
        """Send SIGTERM to a running worker; with `kill`, or while it waits, take the job away."""
        if kill or self.state(handle) is ProcessState.pending:
            self._run("scancel", handle)
        elif self.state(handle) is ProcessState.running:
            self._run("scancel", "--signal=TERM", "--full", handle)

    def close(self) -> None:
        """Nothing to give back: each command is a process of its own."""

    def _run(self, *command: str) -> str:
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                timeout=_TIMEOUT_S,
                check=True,
                stdin=subprocess.DEVNULL,
            )
        except FileNotFoundError as error:
            raise EngineError(
                f"There is no {command[0]} on this machine. Install SLURM's client, or set `engine` to "
                "another one in jobs.toml."
            ) from error
        except subprocess.TimeoutExpired as error:
            raise EngineError(f"SLURM's {command[0]} did not answer within {_TIMEOUT_S:g} s.") from error
        except subprocess.CalledProcessError as error:
            raise EngineError(
                f"SLURM's {command[0]} failed: {error.stderr.strip() or error.returncode}. "
                "Check that the controller runs (`scontrol ping`) and the [slurm] part of jobs.toml."
            ) from error
        return done.stdout
