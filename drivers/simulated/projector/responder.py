"""The contract of a responder: whole commands in, replies with their delay out."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from drivers.simulated.projector.state import TwinState


@dataclass(frozen=True)
class Reply:
    """Bytes that leave `delay_s` after the command."""

    data: bytes
    delay_s: float = 0.0


@runtime_checkable
class Responder(Protocol):
    """A dialect from the projector's side. `error` is its way to refuse, `news` what it says unasked.

    It hangs up when nothing was asked for `idle_s`; None: never.
    """

    state: TwinState
    error: bytes
    news: bytes
    idle_s: float | None

    def greeting(self) -> bytes:
        """Return what is said when a line opens."""
        ...

    def split(self, buffer: bytes) -> tuple[list[bytes], bytes]:
        """Return whole commands and the rest."""
        ...

    def respond(self, command: bytes) -> list[Reply]:
        """Return the replies to one command; none means silence."""
        ...


class CrCommands:
    """What the dialects share whose commands end with CR, and who wait to be spoken to."""

    idle_s: float | None = None

    def __init__(self, state: TwinState) -> None:
        self.state = state

    def greeting(self) -> bytes:
        """Nothing."""
        return b""

    def split(self, buffer: bytes) -> tuple[list[bytes], bytes]:
        """Commands end with CR."""
        *commands, rest = buffer.split(b"\r")
        return commands, rest
