"""The projector as it stands, what it may be told, and its traffic."""

from typing import Literal

from pydantic import Field

from app.api.models.strict import Named, WireModel


class ProjectorResource(WireModel):
    """A projector; what it does not know is null. `for_s` is how long it has been in this state.

    `view` is the number of the first view that sees by it.
    """

    device: Literal["projector"] = "projector"
    view: int
    state: Literal["closed", "standby", "warming", "on", "cooling", "fault", "silent", "lost"]
    experiment: str | None
    name: str | None
    source: str | None
    muted: bool | None
    frozen: bool | None
    lamp_hours: int | None
    lamp_on_s: float | None
    for_s: float | None
    errors: list[str]
    capabilities: list[str]
    reason: str


class OpenProjector(WireModel):
    """Which rig's projector to speak to, by the number of a view that sees by it."""

    experiment: Named
    view: int = Field(default=0, ge=0, lt=100)


class ProjectorChange(WireModel):
    """What to tell a view's projector; what is left out stays. Power takes minutes: `state` says how far it is."""

    view: int = Field(default=0, ge=0, lt=100)
    power: Literal["on", "off"] | None = None
    source: str | None = Field(default=None, min_length=1, max_length=16, pattern="^[A-Za-z0-9]+$")
    muted: bool | None = None
    frozen: bool | None = None


class WireLine(WireModel):
    """One piece of traffic: > sent, < received, ! a remark; control bytes are spelled out."""

    at_s: float
    direction: str
    text: str
