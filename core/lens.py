"""Between pixels and directions through Brown-Conrady distortion, in NumPy; the way back by Newton's method.

Our own, because OpenCV's interface to it differs between 4.x and 5 and its default stops at 5 iterations.
"""

import numpy as np
from jaxtyping import Bool, Float

from core.geometry import Optics

_STEPS = 8
# What the last step leaves where it met the direction: some 1e-16, or 0.01 px of a lens of 10,000 px.
_MET = 1e-6


def directions(
    matrix: Float[np.ndarray, "3 3"], distortion: Float[np.ndarray, "5"], pixels_px: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 3"]:
    """Directions in the lens's own frame, with z = 1, of pixels (column, row); anything where none leads there."""
    seen = (pixels_px - matrix[:2, 2]) / matrix[[0, 1], [0, 1]]
    k1, k2, p1, p2, k3 = distortion
    x, y = seen.T.copy()
    for _ in range(_STEPS if np.any(distortion) else 0):
        ex, ey = _distorted(x, y, distortion) - seen.T
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
        a = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        b = x * y * slope + 2 * p1 * x + 2 * p2 * y
        d = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        determinant = a * d - b * b
        x, y = x - (d * ex - b * ey) / determinant, y - (a * ey - b * ex) / determinant
    return np.stack([x, y, np.ones_like(x)], axis=1)


def has_direction(
    matrix: Float[np.ndarray, "3 3"], distortion: Float[np.ndarray, "5"], pixels_px: Float[np.ndarray, "n 2"]
) -> Bool[np.ndarray, " n"]:
    """Whether `directions` knows what pixels (column, row) see.

    Far enough from the axis a distortion turns back: it shows nothing further out, and what is further in twice.
    """
    seen = (pixels_px - matrix[:2, 2]) / matrix[[0, 1], [0, 1]]
    with np.errstate(all="ignore"):
        x, y, _ = directions(matrix, distortion, pixels_px).T
        left = np.abs(_distorted(x, y, distortion) - seen.T).max(axis=0)
        return (left < _MET) & (x * x + y * y < _turns_back_at(distortion))


def _turns_back_at(distortion: Float[np.ndarray, "5"]) -> float:
    """The least squared distance from the axis at which r (1 + k1 r^2 + k2 r^4 + k3 r^6) no longer grows."""
    k1, k2, _, _, k3 = distortion
    squares = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
    return float(np.min(squares.real[np.isreal(squares) & (squares.real > 0)], initial=np.inf))


def _distorted(
    x: Float[np.ndarray, " points"], y: Float[np.ndarray, " points"], distortion: Float[np.ndarray, "5"]
) -> Float[np.ndarray, "2 points"]:
    """Brown-Conrady, OpenCV's order (k1, k2, p1, p2, k3), on the plane at distance 1."""
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    tangential = 2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([x * radial + tangential[0], y * radial + tangential[1]])


def on_plane(optics: Optics, pixels_px: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 2"]:
    """Where the rays of pixels (column, row) meet the plane at distance 1 before the lens: to the right, down."""
    return directions(_matrix(optics), np.array(optics.distortion), pixels_px)[:, :2]


def sees_along(optics: Optics, pixels_px: Float[np.ndarray, "points 2"]) -> Bool[np.ndarray, " points"]:
    """Whether it is known along which ray pixels (column, row) see: see `has_direction`."""
    return has_direction(_matrix(optics), np.array(optics.distortion), pixels_px)


def seen_at(optics: Optics, plane: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 2"]:
    """The pixels (column, row) of points of that plane: the inverse of `on_plane`."""
    seen = _distorted(plane[:, 0], plane[:, 1], np.array(optics.distortion)).T
    return np.array(optics.principal_px) + np.array(optics.focal_px) * seen


def _matrix(optics: Optics) -> Float[np.ndarray, "3 3"]:
    (fx, fy), (cx, cy) = optics.focal_px, optics.principal_px
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
