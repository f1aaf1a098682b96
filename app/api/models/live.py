"""T of the bursts of a series, as they come."""

from typing import Literal

from app.api.models.strict import WireModel


class LivePlaneResource(WireModel):
    """T in the middle of the room, over x and z, of one burst.

    `scale_k` is the same for all bursts of a series. `noise_k` is what the pictures' noise makes of T, rms; `took_s`
    how long it took once the burst was on the disk.
    """

    capture: str
    created: str
    x_m: list[float]
    z_m: list[float]
    noise_k: float
    took_s: float
    scale_k: list[float]
    lowest_k: float
    highest_k: float


class LiveResource(WireModel):
    """What is looked at; `reason` says what is missing or failed, `skipped` how many bursts were passed over."""

    state: Literal["off", "preparing", "ready", "working", "missing", "failed"]
    experiment: str | None
    capture: str | None
    reason: str
    skipped: int
    plane: LivePlaneResource | None
