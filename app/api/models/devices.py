"""The camera as it stands, and what it may be told."""

from typing import Literal

from pydantic import Field

from app.api.models.strict import Named, WireModel


class CameraResource(WireModel):
    """The camera of a view, by its number; numbers are null until it is open."""

    device: Literal["camera"] = "camera"
    view: int
    state: Literal["closed", "opening", "ready", "capturing", "failed"]
    experiment: str | None
    name: str | None
    width_px: int | None
    height_px: int | None
    bits: int | None
    frame_rate_hz: float | None
    exposure_s: float | None
    gain: float | None
    reason: str


class OpenCamera(WireModel):
    """Which rig to connect, and the camera of which of its views; `air` is what a simulated room does."""

    experiment: Named
    view: int = Field(default=0, ge=0, lt=100)
    air: Literal["still", "moving"] = "still"


class CameraChange(WireModel):
    """What to set of a view's camera; what is left out stays."""

    view: int = Field(default=0, ge=0, lt=100)
    exposure_s: float | None = Field(default=None, gt=0, le=60)
    gain: float | None = Field(default=None, ge=0, le=1000)


class Asked(WireModel):
    """What a viewer sends: how many frames it can take now, and how it wants them."""

    credits: int = Field(default=1, ge=0, le=8)
    stretch: bool = False
