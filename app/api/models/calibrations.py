"""What is known of camera, projector and wall, as it crosses the API."""

from typing import Literal

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
