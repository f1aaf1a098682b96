"""Boards: where their points are [m], how they look, and where a picture shows them.

Chessboard: `columns` x `rows` INNER corners. ChArUco: `columns` x `rows` squares, any part of it may be
seen. Circle grid: `columns` x `rows` centres; a circle's picture is an ellipse whose centre is not the
centre's picture (some 0.01 px at 20 px radius and 30 degrees), so corners are preferred.
"""

from dataclasses import dataclass
from typing import assert_never

import cv2
import numpy as np
from jaxtyping import Float, Int, Shaped

from calibration.board_kind import BoardKind
from calibration.errors import CalibrationError

Image = Shaped[np.ndarray, "rows cols"]


@dataclass(frozen=True)
class Detection:
    """The board points that a picture shows: their numbers on the board and their positions (x, y)."""

    ids: Int[np.ndarray, " points"]
    pixels_px: Float[np.ndarray, "points 2"]


# OpenCV's detectors stop with an assertion on pictures smaller than that.
_LEAST_SQUARE_PX = 3


@dataclass(frozen=True)
class Chessboard:
    """A chessboard by its inner corners."""

    columns: int
    rows: int
    square_m: float

    def __post_init__(self) -> None:
        _check_size(self.columns, self.rows, self.square_m)

    @property
    def pitch_m(self) -> float:
        """Size of a square."""
        return self.square_m

    @property
    def points_m(self) -> Float[np.ndarray, "points 3"]:
        """Corners on the board plane z = 0, row by row."""
        return _grid_m(self.columns, self.rows, self.square_m)

    def detect(self, image: Image) -> Detection | None:
        """All corners, or none: a chessboard must be seen whole."""
        grey = to_8_bit(image)
        size = (self.columns, self.rows)
        if min(grey.shape) < _LEAST_SQUARE_PX * min(size):
            return None
        found, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        if not found:
            flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
            found, corners = cv2.findChessboardCorners(grey, size, flags=flags)
        if not found:
            return None
        pixels = np.asarray(corners, np.float64).reshape(-1, 2)
        spacing = _spacing_px(pixels.reshape(self.rows, self.columns, 2))
        return Detection(np.arange(len(pixels)), refine(image, pixels, 0.3 * spacing))

    def draw(self, px_per_square: int) -> np.ndarray:
        """The board as 8-bit print, with one square of white margin; corner 0 is at (2, 2) squares."""
        squares = np.indices((self.rows + 1, self.columns + 1)).sum(0) % 2
        return _print_out(squares, px_per_square)


@dataclass(frozen=True)
class CharucoBoard:
    """A chessboard of `columns` x `rows` squares with markers in the white ones (OpenCV's ChArUco)."""

    columns: int
    rows: int
    square_m: float
    marker_m: float
    dictionary: str = "DICT_5X5_250"
    legacy: bool = False

    def __post_init__(self) -> None:
        _check_size(self.columns, self.rows, self.square_m)
        if not 0 < self.marker_m < self.square_m:
            raise CalibrationError(
                f"The markers are {self.marker_m:g} m in squares of {self.square_m:g} m; "
                "expected markers smaller than squares. Measure the print and give both in metres."
            )
        if not (self.dictionary.startswith("DICT_") and hasattr(cv2.aruco, self.dictionary)):
            raise CalibrationError(
                f"Unknown marker dictionary {self.dictionary!r}; give OpenCV's name, such as DICT_5X5_250."
            )

    @property
    def pitch_m(self) -> float:
        """Size of a square."""
        return self.square_m

    @property
    def points_m(self) -> Float[np.ndarray, "points 3"]:
        """Inner corners on the board plane z = 0, row by row; (0, 0) is the board's own corner."""
        return np.asarray(self._board().getChessboardCorners(), np.float64).reshape(-1, 3)

    def detect(self, image: Image) -> Detection | None:
        """The corners that are seen; none if fewer than six are."""
        corners, ids, _, _ = cv2.aruco.CharucoDetector(self._board()).detectBoard(to_8_bit(image))
        if ids is None or np.size(ids) < 6:
            return None
        pixels = np.asarray(corners, np.float64).reshape(-1, 2)
        numbers = np.asarray(ids, np.int64).reshape(-1)
        grid = np.full((self.rows - 1, self.columns - 1, 2), np.nan)
        grid.reshape(-1, 2)[numbers] = pixels
        # The window must end before the marker, half the difference of the sizes away.
        margin = (1 - self.marker_m / self.square_m) / 2
        return Detection(numbers, refine(image, pixels, _spacing_px(grid) * min(0.8 * margin, 0.3)))

    def draw(self, px_per_square: int) -> np.ndarray:
        """The board as 8-bit print, with one square of white margin."""
        size = ((self.columns + 2) * px_per_square, (self.rows + 2) * px_per_square)
        return self._board().generateImage(size, marginSize=px_per_square)

    def _board(self) -> cv2.aruco.CharucoBoard:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_m, self.marker_m, dictionary)
        board.setLegacyPattern(self.legacy)
        return board


@dataclass(frozen=True)
class CircleGrid:
    """Dark circles on white; `asymmetric` shifts every other row by half a step (OpenCV's layout).

    `spacing_m` is the distance between neighbours in a row (asymmetric: half of it between rows).
    """

    columns: int
    rows: int
    spacing_m: float
    asymmetric: bool = False

    def __post_init__(self) -> None:
        _check_size(self.columns, self.rows, self.spacing_m)

    @property
    def pitch_m(self) -> float:
        """From circle to circle in a row."""
        return self.spacing_m

    @property
    def points_m(self) -> Float[np.ndarray, "points 3"]:
        """Centres on the board plane z = 0, row by row."""
        if not self.asymmetric:
            return _grid_m(self.columns, self.rows, self.spacing_m)
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        x_m = (2 * column + row % 2) * self.spacing_m / 2
        return np.stack([x_m, row * self.spacing_m / 2, np.zeros(len(row))], axis=1)

    def detect(self, image: Image) -> Detection | None:
        """All centres, or none."""
        flags = cv2.CALIB_CB_ASYMMETRIC_GRID if self.asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
        found, centres = cv2.findCirclesGrid(to_8_bit(image), (self.columns, self.rows), flags=flags)
        if not found:
            return None
        pixels = np.asarray(centres, np.float64).reshape(-1, 2)
        return Detection(np.arange(len(pixels)), pixels)

    def draw(self, px_per_square: int) -> np.ndarray:
        """The grid as 8-bit print: one spacing is `px_per_square`, circle 0 is at (2, 2) spacings."""
        points = self.points_m[:, :2] / self.spacing_m + 2.0
        width, height = np.ceil(points.max(0) + 2.0) * px_per_square
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        picture = np.full(x.shape, 255.0)
        radius = 0.2 if self.asymmetric else 0.3
        for px, py in points * px_per_square:
            distance = np.hypot(x + 0.5 - px, y + 0.5 - py) - radius * px_per_square
            picture = np.minimum(picture, 255.0 * np.clip(distance + 0.5, 0, 1))
        return picture.astype(np.uint8)


Board = Chessboard | CharucoBoard | CircleGrid
# A marker's edge where nobody tells it, in squares.
_MARKER = 0.75


def board_of(
    kind: BoardKind, columns: int, rows: int, pitch_m: float, marker_m: float | None, dictionary: str
) -> Board:
    """The board of a kind; marker and dictionary are a ChArUco board's. Raises CalibrationError."""
    match kind:
        case "chessboard":
            return Chessboard(columns, rows, pitch_m)
        case "charuco":
            return CharucoBoard(columns, rows, pitch_m, marker_m or _MARKER * pitch_m, dictionary)
        case "circles" | "asymmetric-circles":
            return CircleGrid(columns, rows, pitch_m, kind == "asymmetric-circles")
        case _:
            assert_never(kind)


def fixes_pose(points_m: Float[np.ndarray, "points 3"]) -> bool:
    """Whether board points tell how the board stands: two rows and two columns do, a row and a point do not."""
    if len(points_m) < 4:
        return False
    for left_out in range(len(points_m)):
        others = np.delete(points_m, left_out, axis=0)
        spread = np.linalg.svd(others - others.mean(axis=0), compute_uv=False)
        if not spread[1] > 1e-6 * spread[0]:
            return False
    return True


def to_8_bit(image: Image) -> np.ndarray:
    """The picture stretched to 8 bits for detection only; 8-bit pictures are returned as they are."""
    if image.dtype == np.uint8:
        return image
    low, high = np.percentile(image[::4, ::4], [0.5, 99.5])
    scaled = (image.astype(np.float32) - low) * (255.0 / max(high - low, 1e-6))
    return np.clip(scaled, 0, 255).astype(np.uint8)


def refine(image: Image, pixels_px: Float[np.ndarray, "points 2"], window_px: float) -> np.ndarray:
    """Saddle points near `pixels_px` in the full bit depth, in windows of half size `window_px`."""
    half = int(np.clip(window_px, 2, 15))
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    start = np.ascontiguousarray(pixels_px, np.float32).reshape(-1, 1, 2)
    # Edges as sharp as a pixel alias, which moves a corner by up to 0.06 px; blurred, by half of that.
    soft = cv2.GaussianBlur(image.astype(np.float32), (0, 0), min(1.5, window_px / 3))
    refined = cv2.cornerSubPix(soft, start.copy(), (half, half), (-1, -1), criteria)
    moved = np.asarray(refined, np.float64).reshape(-1, 2)
    # A corner that runs away from its start has met something else: keep the detector's.
    far = np.linalg.norm(moved - pixels_px, axis=1) > max(half / 2, 1.5)
    return np.where(far[:, None], pixels_px, moved)


def _grid_m(columns: int, rows: int, step_m: float) -> Float[np.ndarray, "points 3"]:
    row, column = np.divmod(np.arange(columns * rows), columns)
    return np.stack([column * step_m, row * step_m, np.zeros(columns * rows)], axis=1)


def _spacing_px(grid_px: Float[np.ndarray, "rows cols 2"]) -> float:
    """The smallest distance between neighbours (nan: not seen)."""
    steps = [np.linalg.norm(np.diff(grid_px, axis=axis), axis=2).ravel() for axis in (0, 1)]
    distances = np.concatenate(steps)
    seen = distances[np.isfinite(distances)]
    return float(seen.min()) if seen.size else 8.0


def _print_out(squares: Int[np.ndarray, "rows cols"], px_per_square: int) -> np.ndarray:
    padded = np.pad(squares, 1, constant_values=1)
    return (np.kron(padded, np.ones((px_per_square, px_per_square))) * 255).astype(np.uint8)


def _check_size(columns: int, rows: int, size_m: float) -> None:
    if columns < 3 or rows < 3 or not 0 < size_m < 10:
        raise CalibrationError(
            f"A board of {columns} x {rows} with steps of {size_m:g} m; expected at least 3 x 3 and "
            "a step above 0 and below 10 m. Give lengths in metres (75 mm is 0.075)."
        )
