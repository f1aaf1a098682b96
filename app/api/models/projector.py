"""The projector as it stands, what it may be told, and its traffic."""

from typing import Literal

from pydantic import Field

from app.api.models.strict import Named, WireModel


class ProjectorResource(WireModel):
    """The projector; what it does not know is null. `for_s` is how long it has been in this state."""

    device: Literal["projector"] = "projector"
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
    """Which rig's projector to speak to."""

    experiment: Named


class ProjectorChange(WireModel):
    """What to tell it; what is left out stays. Power takes minutes: `state` says how far it is."""

    power: Literal["on", "off"] | None = None
    source: str | None = Field(default=None, min_length=1, max_length=16, pattern="^[A-Za-z0-9]+$")
    muted: bool | None = None
    frozen: bool | None = None


class WireLine(WireModel):
    """One piece of traffic: > sent, < received, ! a remark; control bytes are spelled out."""

    at_s: float
    direction: str
    text: str
