"""What a dialect is: pure functions between requests and bytes. No dialect waits, opens or remembers."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

from drivers.projector.protocol import Capability, PowerState


class Verb(StrEnum):
    """Everything that is ever asked of a projector."""

    HELLO = "hello"
    POWER_ON = "power on"
    POWER_OFF = "power off"
    SELECT_SOURCE = "select source"
    MUTE = "mute"
    UNMUTE = "unmute"
    FREEZE = "freeze"
    UNFREEZE = "unfreeze"
    ASK_POWER = "power?"
    ASK_SOURCE = "source?"
    ASK_MUTE = "mute?"
    ASK_FREEZE = "freeze?"
    ASK_HOURS = "hours?"
    ASK_ERRORS = "errors?"
    ASK_NAME = "name?"

    @property
    def asks(self) -> bool:
        """Whether an answer with a value is expected."""
        return self.value.endswith("?")


@dataclass(frozen=True)
class Request:
    """A verb, with the source's code where it selects one."""

    verb: Verb
    argument: str = ""


class AnswerKind(StrEnum):
    """What a message from the projector means for the request that waits."""

    VALUE = "value"
    DONE = "done"
    ABSENT = "absent"
    """It does not know this command, or not this value."""
    BUSY = "busy"
    """Not now: warming, cooling or switching."""
    DENIED = "denied"
    """The password is not the projector's."""
    FAILED = "failed"
    OTHER = "other"
    """Echo, prompt, garbage or news that nobody asked for: keep waiting."""


@dataclass(frozen=True)
class Answer:
    """A decoded message. `power` is set when the message tells the power state, asked or not."""

    kind: AnswerKind
    value: str | int | bool | tuple[str, ...] | None = None
    power: PowerState | None = None


OTHER = Answer(AnswerKind.OTHER)
DONE = Answer(AnswerKind.DONE)
ABSENT = Answer(AnswerKind.ABSENT)
BUSY = Answer(AnswerKind.BUSY)
DENIED = Answer(AnswerKind.DENIED)
FAILED = Answer(AnswerKind.FAILED)


@runtime_checkable
class Dialect(Protocol):
    """One projector language. `timeout_s` is for an ordinary request, `ignition_s` for lighting the lamp.

    `silent_start`: the set that lights the lamp is answered only when it is lit, and nothing else meanwhile.
    `tells_warming`: it knows warming and cooling; others say no more than on and off.
    """

    name: str
    hdmi: str
    timeout_s: float
    ignition_s: float
    cooling_s: float
    silent_start: bool
    tells_warming: bool
    capabilities: frozenset[Capability]

    def encode(self, request: Request) -> bytes | None:
        """Return the bytes to send; None when the language has no words for it."""
        ...

    def split(self, buffer: bytes, *, idle: bool) -> tuple[list[bytes], bytes]:
        """Return the whole messages in `buffer` and the rest; `idle`: the line has gone quiet."""
        ...

    def decode(self, request: Request, message: bytes) -> Answer:
        """Return what a message means to the request that waits."""
        ...
