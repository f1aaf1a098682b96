"""The guided calibration: what is wanted, what was found, what is asked for."""

from typing import Annotated, Literal

from pydantic import Field

from app.api.models.board import BoardGeometry
from app.api.models.strict import WireModel

StepText = Literal["camera", "projector", "wall", "response"]


# A pixel of any picture, a metre of any room.
Place = Annotated[float, Field(ge=-1e6, le=1e6)]


class WantedResource(WireModel):
    """What to arrange next, in words; a board's place as parts of the picture, and which edge is nearer."""

    kind: Literal["board", "shared", "place", "wall", "level", "dark", "light"]
    text: str
    column: float | None
    row: float | None
    span: float | None
    nearer: Literal["", "left", "right", "upper", "lower"]
    tilt_deg: float
    roll_deg: float


class GuideView(WireModel):
    """One view of the board; retake it by its name."""

    name: str
    points: int
    rms_px: float | None
    issues: list[str]


class GuideResource(WireModel):
    """A guided calibration. While `state` is running, `done` of `total` pictures of `wanted` are taken.

    `busy` is true also while another step, or another experiment's, takes pictures: none can be begun.
    `started`: this step has taken pictures that are not in use yet; they will be when it wants nothing more.
    `coverage` holds rows of cells from the picture's top left; `residuals_px` holds column, row, and the
    residual there, in pixels of a picture of `width_px` x `height_px`.
    """

    state: Literal["idle", "running", "failed"]
    busy: bool
    step: StepText
    view: str
    reason: str
    wanted: WantedResource | None
    done: int
    total: int
    issues: list[str]
    complete: bool
    started: bool
    views: list[GuideView]
    width_px: int | None
    height_px: int | None
    coverage: list[list[bool]]
    covered: float
    rms_px: float | None
    residuals_px: list[tuple[float, float, float, float]]
    advice: list[str]


class GuideRequest(WireModel):
    """Which step, and how; without a board, the experiment's own is used (rehearsals have one).

    `view` is the camera's, by its name; of one view it may be left out. `anchor` is a wall point seen at u, v whose
    room coordinates [m] across the view were measured: x, z of a y wall, y, z of an x wall, x, y of a z wall.
    """

    step: StepText
    view: str | None = Field(default=None, max_length=200)
    board: BoardGeometry | None = None
    frames: int = Field(default=1, ge=1, le=1000)
    response_frames: int = Field(default=16, ge=2, le=1000)
    settle_s: float = Field(default=0.2, ge=0, le=60)
    anchor: tuple[Place, Place, Place, Place] | None = None
    plumb_px: tuple[Place, Place, Place, Place] | None = None
    ambient_temperature_k: float | None = Field(default=None, ge=150, le=400)
    minutes_on: float | None = Field(default=None, ge=0, le=1e6)
