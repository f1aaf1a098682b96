"""What is known of camera, projector and wall, as it crosses the API."""

from typing import Literal

from pydantic import Field

from app.api.models.strict import WireModel


class CalibrationItem(WireModel):
    """One thing to calibrate, in words for the operator: measured from images, given, or missing."""

    name: str
    state: Literal["measured", "given", "missing"]
    value: str
    advice: str


class StandingResource(WireModel):
    """Where a camera or a projector stands, and where the corners of its picture meet the back wall [m]."""

    name: str
    role: Literal["camera", "projector"]
    position_m: list[float]
    corners_m: list[list[float]]


class CalibrationResource(WireModel):
    """The calibration of an experiment; `room_m` are the room's lower and upper corner.

    Incomplete while a part that the rig needs is missing: camera, wall, and the projector where it is the light.
    """

    state: Literal["calibrated", "incomplete"]
    date: str | None
    items: list[CalibrationItem]
    room_m: list[list[float]]
    rig: list[StandingResource]


class NewCalibration(WireModel):
    """A simulated rig takes its models from its scene; a real one is calibrated on the command line."""

    kind: Literal["simulated"]


class NewTogether(WireModel):
    """Views to be adjusted together by what is there; `tape_std_m` is how well places were measured by tape."""

    tape_std_m: float = Field(default=0.005, ge=1e-6, le=1.0)


class PairResource(WireModel):
    """How far apart two views' cameras stand and how they are turned, each with its standard deviation."""

    views: list[str]
    apart_m: float
    apart_std_m: float
    turned_deg: float
    turned_std_deg: float


class TogetherResource(WireModel):
    """What came of an adjustment: the pairs, how many boards several cameras saw, and what to mind."""

    pairs: list[PairResource]
    boards: int
    rms_px: float
    issues: list[str]
    calibration: CalibrationResource
