"""What the program may ask of a projector. What a projector does not know is absent (None), no failure."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

from drivers.projector.wire_log import WireLog


class PowerState(StrEnum):
    """Every state that a projector can be in. Warming and cooling last minutes: states, not time-outs."""

    STANDBY = "standby"
    WARMING = "warming"
    ON = "on"
    COOLING = "cooling"
    FAULT = "fault"
    SILENT = "silent"
    """It does not answer, although its power and cable are not known to be off."""


class Capability(StrEnum):
    """What a dialect can say; a given model may still know less."""

    POWER = "power"
    SOURCE = "source"
    MUTE = "mute"
    FREEZE = "freeze"
    LAMP_HOURS = "lamp hours"
    ERRORS = "errors"
    NAME = "name"


@dataclass(frozen=True)
class ProjectorStatus:
    """What the projector said when asked; None where it knows no answer.

    `on_s` is how long the lamp has been on as far as is known here.
    """

    power: PowerState
    source: str | None = None
    muted: bool | None = None
    frozen: bool | None = None
    lamp_hours: int | None = None
    errors: tuple[str, ...] = ()
    name: str | None = None
    on_s: float | None = None


@runtime_checkable
class Projector(Protocol):
    """A projector that can be talked to. A context manager: leaving it frees the line, not the lamp."""

    @property
    def capabilities(self) -> frozenset[Capability]:
        """What can be asked of it; shrinks when the model turns out not to know a command."""
        ...

    @property
    def log(self) -> WireLog:
        """Every byte that went over the line, readable."""
        ...

    def power(self) -> PowerState:
        """Return the power state now."""
        ...

    def status(self) -> ProjectorStatus:
        """Return everything that the projector says of itself now."""
        ...

    def turn_on(self) -> None:
        """Begin to light the lamp and return; `power` says WARMING until it is lit.

        Raises DeviceRefusedError when the lamp was off for too short a time.
        """
        ...

    def turn_off(self) -> None:
        """Begin to cool down and return. Raises DeviceRefusedError when the lamp was lit only just now."""
        ...

    def select_source(self, code: str) -> None:
        """Show another input, by the model's own code. Raises DeviceRefusedError."""
        ...

    def mute(self, on: bool) -> None:
        """Make the picture black, or show it again. Raises DeviceRefusedError."""
        ...

    def freeze(self, on: bool) -> None:
        """Hold the picture, or let it go. Raises DeviceRefusedError."""
        ...

    def close(self) -> None:
        """Free the line. Safe to call twice."""
        ...
