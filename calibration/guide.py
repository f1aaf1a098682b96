"""What to show the camera next: a list of board views that together fix a camera or a projector.

The plan spreads the board over the picture and tilts it to every side; a view that was taken ticks off the
one it resembles, in whatever order they come. What is left is asked for, one sentence at a time.
"""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float

from calibration.adjustment import Pose
from calibration.record import SeenBoard, array_of
from calibration.start import guess_intrinsics, guess_pose
from core.geometry import Optics

Nearer = Literal["", "left", "right", "upper", "lower"]

# A view serves a wanted place from this far away (parts of the picture), tilted by at least this much.
_NEAR = 0.22
_TILTED_RAD = 0.15
# A board with its outer squares and white margin, against what its points span.
_WITH_MARGIN = 1.5


@dataclass(frozen=True)
class WantedView:
    """Where to hold the board: its centre at `column`, `row` (parts of the picture), one edge nearer.

    `span` is its height as a part of the picture's; `roll_deg` turns it in its plane.
    """

    column: float
    row: float
    nearer: Nearer = ""
    span: float = 0.4
    tilt_deg: float = 25.0
    roll_deg: float = 0.0

    @property
    def text(self) -> str:
        """The sentence for the operator."""
        tilt = (
            f", its {self.nearer} edge nearer ({self.tilt_deg:.0f} degrees)" if self.nearer else ", facing it"
        )
        turn = f", turned by {self.roll_deg:.0f} degrees" if self.roll_deg else ""
        size = f"up to {100 * self.span:.0f} % of the picture's height, whole, with its white margin"
        return f"Show the board {_place(self.column, self.row)}{tilt}{turn}; {size}."


CAMERA_PLAN = (
    WantedView(0.5, 0.5),
    WantedView(0.28, 0.3, "left"),
    WantedView(0.72, 0.7, "right"),
    WantedView(0.28, 0.7, "upper"),
    WantedView(0.72, 0.3, "lower"),
    WantedView(0.5, 0.5, "left", 0.5, 30.0, 90.0),
    WantedView(0.7, 0.5, "left", 0.45, 35.0),
    WantedView(0.3, 0.5, "right", 0.45, 35.0),
    WantedView(0.5, 0.3, "upper", 0.4, 30.0),
    WantedView(0.5, 0.7, "lower", 0.4, 30.0),
    WantedView(0.25, 0.27, "", 0.35),
    WantedView(0.75, 0.73, "", 0.35, 25.0, 180.0),
)

# Fewer, for each costs a whole Gray-code sequence; less far out, where a projector's light may end.
PROJECTOR_PLAN = (
    WantedView(0.5, 0.5),
    WantedView(0.3, 0.36, "upper"),
    WantedView(0.7, 0.64, "lower"),
    WantedView(0.3, 0.64, "left"),
    WantedView(0.7, 0.36, "right"),
    WantedView(0.5, 0.5, "left", 0.5, 30.0, 90.0),
    WantedView(0.66, 0.36, "lower", 0.4, 30.0),
    WantedView(0.34, 0.64, "right", 0.4, 30.0),
)


@dataclass(frozen=True)
class ShownView:
    """Where a board stood in a picture: centre in parts of the picture, and which edges were nearer."""

    column: float
    row: float
    nearer: tuple[Nearer, ...]


def unmet(
    plan: tuple[WantedView, ...], boards: tuple[SeenBoard, ...], size_px: tuple[int, int]
) -> list[WantedView]:
    """The views of the plan that no board has served yet, each board serving one; in the plan's order."""
    left = list(plan)
    for shown in shown_views(boards, size_px):
        served = [w for w in left if _serves(shown, w)]
        if served:
            left.remove(min(served, key=lambda w: _apart(shown, w)))
    return left


def shown_views(boards: tuple[SeenBoard, ...], size_px: tuple[int, int]) -> list[ShownView]:
    """Places and tilts of boards seen by a camera that need not be calibrated yet."""
    if not boards:
        return []
    points = [array_of(b.points_m, 3) for b in boards]
    pixels = [array_of(b.camera_px, 2) for b in boards]
    guess = guess_intrinsics(points, pixels, size_px, offset_lens=False)
    found = []
    for board_m, seen_px in zip(points, pixels, strict=True):
        column, row = seen_px.mean(axis=0) / size_px
        found.append(
            ShownView(float(column), float(row), nearer_edges(board_m, guess_pose(board_m, seen_px, guess)))
        )
    return found


def nearer_edges(points_m: Float[np.ndarray, "n 3"], pose: Pose) -> tuple[Nearer, ...]:
    """Edges of the board, as the camera sees them, that are clearly nearer than the opposite ones."""
    normal = cv2.Rodrigues(pose.rotation_rad)[0][:, 2]
    # Turned towards the camera; a normal towards the right means that the left edge is the nearer one.
    normal = -normal * np.sign(normal[2])
    x, y = np.arcsin(np.clip(normal[:2], -1, 1))
    found: list[Nearer] = []
    if abs(x) > _TILTED_RAD:
        found.append("left" if x > 0 else "right")
    if abs(y) > _TILTED_RAD:
        found.append("upper" if y > 0 else "lower")
    return tuple(found)


def pose_of(
    wanted: WantedView, camera: Optics, board_size_m: tuple[float, float]
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Rotation of the board into the camera's frame, and the board's centre there [m]."""
    width_m, height_m = board_size_m if wanted.roll_deg % 180 == 0 else board_size_m[::-1]
    # No nearer than where the board, with its margin, still lies within the picture.
    room = (
        2 * min(wanted.column, 1 - wanted.column) * camera.width_px / (_WITH_MARGIN * width_m),
        2 * min(wanted.row, 1 - wanted.row) * camera.height_px / (_WITH_MARGIN * height_m),
        wanted.span * camera.height_px / height_m,
    )
    distance_m = max(camera.focal_px) / min(room)
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_px
    towards = np.array(
        [(wanted.column * camera.width_px - cx) / fx, (wanted.row * camera.height_px - cy) / fy, 1.0]
    )
    tilt = np.radians(wanted.tilt_deg) * (1 if wanted.nearer in ("right", "upper") else -1)
    axis = {"": 0.0, "left": 1.0, "right": 1.0, "upper": 0.0, "lower": 0.0}[wanted.nearer]
    vector = np.array([tilt * (1 - axis), tilt * axis, 0.0]) * bool(wanted.nearer)
    rotation = cv2.Rodrigues(vector)[0] @ cv2.Rodrigues(np.array([0, 0, np.radians(wanted.roll_deg)]))[0]
    return np.asarray(rotation, float), towards * distance_m


def _serves(shown: ShownView, wanted: WantedView) -> bool:
    if max(abs(shown.column - wanted.column), abs(shown.row - wanted.row)) > _NEAR:
        return False
    return wanted.nearer in shown.nearer if wanted.nearer else not shown.nearer


def _apart(shown: ShownView, wanted: WantedView) -> float:
    return float(np.hypot(shown.column - wanted.column, shown.row - wanted.row))


def _place(column: float, row: float) -> str:
    across = "left" if column < 0.37 else "right" if column > 0.63 else ""
    down = "upper" if row < 0.37 else "lower" if row > 0.63 else ""
    if across and down:
        return f"at the {down} {across}"
    return {"upper": "at the top", "lower": "at the bottom"}.get(
        down, f"at the {across}" if across else "in the middle"
    )
