"""An engine starts, stops and reports a process. Queue, retries and fencing are the ledger's."""

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Protocol, runtime_checkable


class ProcessState(Enum):
    """What an engine says of a process it was asked to start."""

    pending = "accepted, not started yet"
    running = "started, as far as the engine knows"
    gone = "ended, or never heard of"
    unknown = "the engine does not answer"


@dataclass(frozen=True, kw_only=True)
class Launch:
    """One attempt to be started. `name` is the same after a crash of the supervisor: it finds the process."""

    job: str
    attempt: int
    folder: Path
    device: str
    memory_bytes: int
    lease_s: float

    @property
    def name(self) -> str:
        """The attempt's name in the engine."""
        return f"airlens-{self.job}-{self.attempt}"

    @property
    def worker_arguments(self) -> list[str]:
        """The command after `python`."""
        attempt, lease_s = str(self.attempt), str(self.lease_s)
        return ["-P", "-m", "app.worker", str(self.folder), "--attempt", attempt, "--lease-s", lease_s]


@runtime_checkable
class Engine(Protocol):
    """Raises EngineError wherever the engine refuses or cannot be reached."""

    @property
    def name(self) -> str:
        """The word that the configuration uses."""
        ...

    def probe(self) -> None:
        """Raise EngineError unless the engine is there and safe to use."""
        ...

    def start(self, launch: Launch) -> str:
        """Start the worker; return a handle that stays valid after a restart of the supervisor."""
        ...

    def find(self, launch: Launch) -> str | None:
        """Return the handle of an attempt that was started before a crash, or None."""
        ...

    def state(self, handle: str) -> ProcessState:
        """Say whether the process is there."""
        ...

    def exit_status(self, handle: str) -> int | None:
        """Return how the process ended, None when the engine does not know."""
        ...

    def stop(self, handle: str, *, kill: bool = False) -> None:
        """Ask the process to write a checkpoint and end, or end it at once; gone already is no error."""
        ...

    def close(self) -> None:
        """Give back connections; the processes go on."""
        ...
