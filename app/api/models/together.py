"""Several cameras calibrated together: the boards that they see at once, and what comes of it."""

from typing import Literal

from pydantic import Field

from app.api.models.board import BoardGeometry
from app.api.models.calibrations import CalibrationResource
from app.api.models.strict import WireModel


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


class MovedResource(WireModel):
    """How far a view's camera was moved by the adjustment, and the standard deviation of where it is now, x, y, z."""

    view: str
    moved_m: float
    position_std_m: list[float]


class TogetherResource(WireModel):
    """What came of an adjustment: the pairs, how many boards several cameras saw, and what to mind."""

    pairs: list[PairResource]
    moved: list[MovedResource]
    boards: int
    rms_px: float
    issues: list[str]
    calibration: CalibrationResource


class PlacesRequest(WireModel):
    """How boards are shown to several cameras at once; without a board, the experiment's own is used.

    `frames` are averaged into a picture; `places` are asked for.
    """

    board: BoardGeometry | None = None
    frames: int = Field(default=1, ge=1, le=1000)
    places: int = Field(default=6, ge=1, le=100)


class SightResource(WireModel):
    """What one camera, that of view number `camera`, found of the newest place: where the board's points are.

    `points_px` are columns and rows in a picture of `width_px` x `height_px`; none where the board was not found.
    """

    view: str
    camera: int
    width_px: int
    height_px: int
    points_px: list[tuple[float, float]]


class SeenResource(WireModel):
    """How many points of a board one camera found."""

    view: str
    points: int


class PlaceResource(WireModel):
    """A place of the board that two cameras or more saw; take it again by its name."""

    place: str
    seen: list[SeenResource]


class PlacesResource(WireModel):
    """Boards before several cameras. While `state` is running, pictures of `wanted` are taken.

    `busy` is true also while a step of one camera takes pictures. `enough` is true once all places that were asked
    for are there. `pairs` say how the cameras stand to one another, where they were adjusted together.
    """

    state: Literal["idle", "running", "failed"]
    busy: bool
    reason: str
    wanted: str | None
    enough: bool
    issues: list[str]
    cameras: list[SightResource]
    places: list[PlaceResource]
    pairs: list[PairResource]
