"""How far the picture moved since the reference, tile by tile, while one watches. For eyes, not for results.

Least squares of image differences on the reference's gradient, brightness and offset fitted along, repeated
on the moved reference (Lucas & Kanade 1981), from a start by phase correlation.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Float32

from drivers.shift import shift_image

TILE_PX = 64
ROUNDS = 4
LARGEST_PX = 8

Image = Float32[np.ndarray, "rows cols"]


@dataclass(frozen=True)
class QuickLook:
    """Shifts as (columns, rows) in pixels. `drift_px` is the border's median; `inner_px` has it taken off."""

    drift_px: tuple[float, float]
    drift_spread_px: float
    inner_px: Float[np.ndarray, "tiles 2"]

    @property
    def largest_px(self) -> float:
        """The 95th percentile of the inner shifts' lengths: a few bad tiles do not count."""
        lengths = np.hypot(self.inner_px[:, 0], self.inner_px[:, 1])
        return float(np.percentile(lengths, 95)) if len(lengths) else 0.0


def quick_look(reference: Image, image: Image, across: int = 12) -> QuickLook:
    """Return the shifts of up to `across` x `across` tiles; the outermost ring is the still border."""
    shifts, border = [], []
    rows, cols = (_starts(length, across) for length in reference.shape)
    for row in rows:
        for col in cols:
            at = np.s_[row : row + TILE_PX, col : col + TILE_PX]
            found = tile_shift(reference[at], image[at])
            if found is not None:
                shifts.append(found)
                border.append(row in (rows[0], rows[-1]) or col in (cols[0], cols[-1]))
    found, is_border = np.array(shifts, float).reshape(-1, 2), np.array(border, bool)
    edge = found[is_border]
    drift = np.median(edge, axis=0) if len(edge) else np.zeros(2)
    spread = float(1.4826 * np.median(np.abs(edge - drift))) if len(edge) else 0.0
    return QuickLook((float(drift[0]), float(drift[1])), spread, found[~is_border] - drift)


def tile_shift(reference: Image, image: Image) -> tuple[float, float] | None:
    """Return (columns, rows) by which `image` is moved against `reference`; None without texture."""
    blurred, target = (cv2.GaussianBlur(one, (0, 0), 1.0) for one in (reference, image))
    window = cv2.createHanningWindow(blurred.shape[::-1], cv2.CV_32F)
    # Copies: phaseCorrelate of OpenCV 5.0 multiplies its inputs by the window in place.
    start, _ = cv2.phaseCorrelate(blurred - blurred.mean(), target - target.mean(), window)
    shift, inner = np.clip(np.rint(start), -LARGEST_PX, LARGEST_PX), np.s_[10:-10, 10:-10]
    for _ in range(ROUNDS):
        moved = shift_image(blurred, (float(shift[0]), float(shift[1]))) if shift.any() else blurred
        slope_row, slope_col = np.gradient(moved)
        columns = [-slope_col[inner], -slope_row[inner], moved[inner], np.ones_like(moved[inner])]
        design = np.stack([column.ravel() for column in columns], axis=1).astype(float)
        normal = design.T @ design
        if np.linalg.cond(normal) > 1e9:
            return None
        step = np.linalg.solve(normal, design.T @ (target - moved)[inner].ravel().astype(float))
        shift = shift + step[:2]
        if not np.abs(shift).max() <= LARGEST_PX + 1:
            return None
    return float(shift[0]), float(shift[1])


def _starts(length: int, across: int) -> list[int]:
    count = max(1, min(across, length // TILE_PX))
    return sorted({int(start) for start in np.linspace(0, max(length - TILE_PX, 0), count)})
