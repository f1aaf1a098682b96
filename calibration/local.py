"""Where a projector sees given camera positions: local homographies (Moreno & Taubin 2012).

Around each position the map camera -> panel is fitted as a homography to the stripe edges nearby (or,
where the camera is too coarse to separate stripes, to the decoded pixels); the position is carried
through it. Edges bind one panel coordinate each, so the fit is linear in the homography's eight ratios.
"""

import numpy as np
from jaxtyping import Bool, Float

from calibration.graycode import Decoded
from calibration.stripes import EdgeMap, edges_near

MINIMUM_EQUATIONS = 60
# Homographies that predict worse than this [projector px] hold wrong codes or a bent surface.
WORST_RMS_PX = 1.5

Equations = tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]


def on_panel(
    decoded: Decoded, edges: tuple[EdgeMap, ...], pixels_px: Float[np.ndarray, "points 2"], half_px: int
) -> tuple[Float[np.ndarray, "points 2"], Bool[np.ndarray, " points"], Float[np.ndarray, " points"]]:
    """Panel positions of camera positions, which of them are good, and each fit's rms [projector px]."""
    places = np.full((len(pixels_px), 2), np.nan)
    rms = np.full(len(pixels_px), np.inf)
    for number, pixel in enumerate(pixels_px):
        equations = edges_near(edges, pixel, half_px)
        if min(np.sum(equations[2] == axis) for axis in (0, 1)) < MINIMUM_EQUATIONS / 2:
            equations = _codes_near(decoded, pixel, half_px)
        found = _fit(equations, pixel, half_px)
        if found is not None:
            places[number], rms[number] = found
    return places, rms < WORST_RMS_PX, rms


def _codes_near(decoded: Decoded, pixel: Float[np.ndarray, "2"], half_px: int) -> Equations:
    """Both coordinates of every decoded pixel in the window."""
    x, y = np.round(pixel).astype(int)
    top, left = max(y - half_px, 0), max(x - half_px, 0)
    window = np.s_[top : y + half_px + 1, left : x + half_px + 1]
    row, column = np.nonzero(decoded.lit[window])
    place = np.stack([column + left, row + top], axis=1).astype(float)
    codes = [decoded.column_px[window][row, column], decoded.row_px[window][row, column]]
    return np.tile(place, (2, 1)), np.concatenate(codes).astype(float), np.repeat([0.0, 1.0], len(row))


def _fit(
    equations: Equations, pixel: Float[np.ndarray, "2"], half_px: int
) -> tuple[np.ndarray, float] | None:
    """Panel position of `pixel` and the fit's rms; none if the window holds too little."""
    place, code, axis = equations
    local = (place - pixel) / half_px
    is_row = axis == 1
    if min(is_row.sum(), (~is_row).sum()) < MINIMUM_EQUATIONS / 2:
        return None
    centre = np.array([np.median(code[~is_row]), np.median(code[is_row])])
    value = code - centre[axis.astype(int)]
    kept = np.abs(value) < 8 * half_px
    # Twice: the first fit finds the wrong codes, the second is free of them.
    ratios, rms = np.zeros(8), np.inf
    for _ in range(2):
        if min((kept & is_row).sum(), (kept & ~is_row).sum()) < MINIMUM_EQUATIONS / 2:
            return None
        ratios = _solve(local[kept], value[kept], is_row[kept])
        residual = np.abs(_predict(ratios, local, is_row) - value)
        rms = float(np.sqrt(np.mean(residual[kept] ** 2)))
        kept = residual < max(4.0 * float(np.median(residual[kept])), 0.2)
    return ratios[[2, 5]] + centre, rms


def _solve(local: np.ndarray, value: np.ndarray, is_row: np.ndarray) -> Float[np.ndarray, "8"]:
    """Ratios (a b c, d e f, g h) of u = (a x + b y + c) / (g x + h y + 1), v likewise."""
    x, y = local.T
    one = np.stack([x, y, np.ones_like(x)], axis=1)
    design = np.zeros((len(x), 8))
    design[~is_row, :3] = one[~is_row]
    design[is_row, 3:6] = one[is_row]
    design[:, 6:] = -local * value[:, None]
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    return np.linalg.lstsq(design / scale, value, rcond=1e-10)[0] / scale


def _predict(ratios: np.ndarray, local: np.ndarray, is_row: np.ndarray) -> np.ndarray:
    numerators = local @ ratios[[0, 1, 3, 4]].reshape(2, 2).T + ratios[[2, 5]]
    return np.where(is_row, numerators[:, 1], numerators[:, 0]) / (local @ ratios[6:] + 1.0)
