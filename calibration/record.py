"""What the pictures of a calibration showed, kept so that each step can add to it and start again.

A bundle is a pure function of its record (`calibration.model`), so a partial calibration is a record
with less in it. Positions in pixels, board points in metres.
"""

import json
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from calibration import strict
from calibration.errors import BundleError
from calibration.views import BoardView
from core.geometry import WallName

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class SeenBoard:
    """One picture of a board: points seen by the camera, and those of them that the projector lights."""

    name: str
    sha256: str
    points_m: Rows
    camera_px: Rows
    panel_points_m: Rows = ()
    panel_px: Rows = ()
    edge_width_px: float = 0.0
    issues: tuple[str, ...] = ()


@dataclass(frozen=True)
class SeenWall:
    """Correspondences on the bare wall."""

    name: str
    sha256: str
    camera_px: Rows
    panel_px: Rows
    issues: tuple[str, ...] = ()


@dataclass(frozen=True)
class Placement:
    """How the world lies: a point of the wall with measured x and z, the wall's y, and the vertical.

    `wall` is the room's wall that the camera looks at; x, y and z are those of the view's own frame, in which that
    wall is y_max (`core.view_frame`). `plumb_px` are two camera positions (u, v, u, v), lower and upper end of a
    vertical line on the wall.
    """

    anchor_px: tuple[float, float] | None = None
    x_m: float = 0.0
    z_m: float = 0.0
    wall_y_m: float | None = None
    plumb_px: tuple[float, float, float, float] | None = None
    wall: WallName = "y_max"


@dataclass(frozen=True)
class Record:
    """Everything seen by one camera (and the projector, if any)."""

    camera: str
    camera_size_px: tuple[int, int]
    panel_size_px: tuple[int, int] | None = None
    boards: tuple[SeenBoard, ...] = ()
    wall: SeenWall | None = None
    level: SeenBoard | None = None
    placement: Placement = Placement()

    def with_boards(self, boards: tuple[SeenBoard, ...]) -> "Record":
        """This record with `boards` added; a picture seen before is replaced."""
        new = {b.sha256 for b in boards}
        kept = tuple(b for b in self.boards if b.sha256 not in new)
        return replace(self, boards=kept + boards)


def seen_board(view: BoardView, sha256: str) -> SeenBoard:
    """The view's detection as it is kept. The view must be usable."""
    if view.detection is None:
        raise BundleError(f"{view.name} shows no board; keep usable views only.")
    return SeenBoard(
        name=view.name,
        sha256=sha256,
        points_m=rows_of(view.points_m),
        camera_px=rows_of(view.detection.pixels_px),
        edge_width_px=view.edge_width_px,
        issues=view.issues,
    )


def rows_of(array: Float[np.ndarray, "rows cols"]) -> Rows:
    """The array as nested tuples."""
    return tuple(tuple(map(float, row)) for row in array)


def array_of(rows: Rows, columns: int) -> Float[np.ndarray, "rows cols"]:
    """Nested tuples as an array."""
    return np.array(rows, float).reshape(-1, columns)


def record_to_json(record: Record) -> str:
    """The record as JSON text."""
    return json.dumps(strict.encode(record), allow_nan=False) + "\n"


def record_from_json(text: str, source: str) -> Record:
    """The record in JSON text.

    Raises:
        BundleError: not JSON, an unknown or missing key, a wrong type.
    """
    return strict.from_json(Record, text, source, "Remove it and calibrate again.")
