"""One picture of a board, and what is wrong with it before any fitting: saturation, blur, size."""

import hashlib
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from calibration.board import Board, Detection, Image, fixes_pose
from calibration.errors import ImageError
from calibration.saturation import saturated_from

# Edges wider than this [px, 0 to 100 % at full slope] blur corners by more than the noise does.
BLUR_PX = 6.0
SATURATED_FRACTION = 0.01
ONE_ROW = (
    "a single row of the board is seen, which does not tell how the board stands. Retake it with at least two rows "
    "and two columns in the picture."
)


@dataclass(frozen=True)
class BoardView:
    """A board seen in one picture; `issues` says what to retake."""

    name: str
    width_px: int
    height_px: int
    detection: Detection | None
    points_m: Float[np.ndarray, "points 3"]
    edge_width_px: float = 0.0
    issues: tuple[str, ...] = ()

    @property
    def usable(self) -> bool:
        """Whether the board was found."""
        return self.detection is not None


def view_of(name: str, image: Image, board: Board, full_scale: int | None = None) -> BoardView:
    """Look for `board` in `image`; `full_scale` is the largest count (default: the type's maximum)."""
    if image.ndim != 2 or min(image.shape) < 16:
        raise ImageError(f"{name} has shape {image.shape}; expected one grey picture of at least 16 x 16 px.")
    height, width = image.shape
    detection = board.detect(image)
    if detection is None:
        issue = f"{name}: the board was not found. Retake it whole, sharp, evenly lit, with a white margin."
        return BoardView(name, width, height, None, np.zeros((0, 3)), issues=(issue,))
    points_m = board.points_m[detection.ids]
    if not fixes_pose(points_m):
        issue = f"{name}: {ONE_ROW}"
        return BoardView(name, width, height, None, np.zeros((0, 3)), issues=(issue,))
    issues = []
    saturated = _saturated_fraction(image, detection, full_scale)
    if saturated > SATURATED_FRACTION:
        issues.append(
            f"{name}: {100 * saturated:.0f} % of the board is saturated. Retake it with a shorter exposure."
        )
    edge_px = _edge_width_px(image, points_m, detection.pixels_px)
    if edge_px > BLUR_PX:
        issues.append(
            f"{name}: edges are {edge_px:.1f} px wide (blur). Retake it in focus and without motion."
        )
    return BoardView(name, width, height, detection, points_m, edge_px, tuple(issues))


def digest(image: Image) -> str:
    """SHA-256 of the picture's values."""
    return hashlib.sha256(np.ascontiguousarray(image).tobytes()).hexdigest()


def _saturated_fraction(image: Image, detection: Detection, full_scale: int | None) -> float:
    if full_scale is None:
        if not np.issubdtype(image.dtype, np.integer):
            return 0.0
        full_scale = int(np.iinfo(image.dtype).max)
    hull = cv2.convexHull(detection.pixels_px.astype(np.float32))
    mask = np.zeros(image.shape, np.uint8)
    cv2.fillConvexPoly(mask, hull.astype(np.int32), 1)
    inside = image[mask > 0]
    return float(np.mean(inside >= saturated_from((image,), full_scale))) if inside.size else 0.0


def _edge_width_px(image: Image, points_m: np.ndarray, pixels_px: np.ndarray) -> float:
    """Contrast over the steepest slope, across the blurrier of the board's two edge directions."""
    homography, _ = cv2.findHomography(points_m[:, :2], pixels_px)
    if homography is None:
        return 0.0
    step_m = float(np.min(np.linalg.norm(np.diff(points_m, axis=0), axis=1)))
    smooth = cv2.GaussianBlur(image.astype(np.float32), (3, 3), 0)
    gy, gx = np.gradient(smooth)
    widths = []
    for point_m, pixel in zip(points_m, pixels_px, strict=True):
        x, y = np.round(pixel).astype(int)
        rim = np.array([[0.3, 0], [0, 0.3], [-0.3, 0], [0, -0.3]]) * step_m + point_m[:2]
        around = cv2.perspectiveTransform(rim[None].astype(np.float64), homography)[0]
        half = int(np.clip(np.abs(around - pixel).max(), 4, 20))
        if not (half <= x < image.shape[1] - half and half <= y < image.shape[0] - half):
            continue
        window = np.s_[y - half : y + half + 1, x - half : x + half + 1]
        low, high = np.percentile(smooth[window], [5, 95])
        for along in (around[0] - around[2], around[1] - around[3]):
            across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            slope = np.percentile(np.abs(gx[window] * across[0] + gy[window] * across[1]), 99)
            widths.append((high - low) / max(slope, 1e-9))
    if not widths:
        return 0.0
    pairs = np.array(widths).reshape(-1, 2)
    return float(np.median(pairs.max(axis=1)))
