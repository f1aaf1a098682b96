"""What is printed for an experiment."""

from typing import Literal

from pydantic import Field

from app.api.models.board import BoardGeometry
from app.api.models.strict import WireModel


class NewPattern(WireModel):
    """Sheets of a wall's pattern; `choose` first gives the scene the finest pattern that suits its camera.

    `view` says whose wall; without it the first one's.
    """

    view: str | None = Field(default=None, max_length=200)
    paper: str = Field(default="a3", max_length=20)
    overlap_m: float = Field(default=0.01, ge=0, le=0.1)
    choose: bool = False


class NewBoard(WireModel):
    """A board to calibrate with: the rig's own unless given. Without `square_m` the largest that fits the paper."""

    paper: str = Field(default="a3", max_length=20)
    board: BoardGeometry | None = None


class PrintedResource(WireModel):
    """A PDF that was made: rows and columns of its sheets, what is on them, and the finest period.

    `view` is whose wall's pattern it is; null is the first one's.
    """

    view: str | None
    what: Literal["pattern", "board"]
    paper: str
    sheets: list[int]
    width_m: float
    height_m: float
    finest_period_m: float | None
    finest_period_camera_px: float | None
    created: str
    is_of_the_scene: bool
