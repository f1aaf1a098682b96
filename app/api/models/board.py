"""The board that a rig is calibrated with, as it crosses the API."""

from pydantic import Field

from app.api.models.strict import WireModel
from calibration.board_kind import BoardKind


class BoardGeometry(WireModel):
    """A board: inner corners of a chessboard, squares of a ChArUco board, circles."""

    kind: BoardKind = "chessboard"
    columns: int = Field(ge=2, le=200)
    rows: int = Field(ge=2, le=200)
    square_m: float = Field(gt=0, le=10)
    marker_m: float | None = Field(default=None, gt=0, le=10)
    dictionary: str = Field(default="DICT_5X5_250", max_length=40)
