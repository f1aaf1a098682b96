"""The back wall from Gray code on it: triangulated points, a plane through them, and its flatness.

Correspondences are taken on a grid of camera positions, each through a local homography, which
averages the code's quantisation; then every pair of rays meets in the middle of their shortest
connection, and a plane is fitted robustly (least squares on the points within three scatter widths).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float

from calibration.adjustment import Device
from calibration.errors import ImageError
from calibration.graycode import Decoded
from calibration.local import on_panel
from calibration.stripes import EdgeMap
from core.lens import directions

MINIMUM_POINTS = 30
# Squared sine of the angle between two rays: a baseline of a millionth of the distance.
_LEAST_PARALLAX = 1e-12


@dataclass(frozen=True)
class Correspondences:
    """Camera positions and the projector positions that light them."""

    camera_px: Float[np.ndarray, "points 2"]
    projector_px: Float[np.ndarray, "points 2"]


@dataclass(frozen=True)
class Plane:
    """normal . x = offset_m in the camera's frame, the normal pointing away from the camera.

    `flatness_rms_m` is the points' scatter about it, noise included; `inliers` are the points used.
    """

    normal: Float[np.ndarray, "3"]
    offset_m: float
    flatness_rms_m: float
    centre_m: Float[np.ndarray, "3"]
    inliers: Bool[np.ndarray, " points"]


def correspondences(decoded: Decoded, edges: tuple[EdgeMap, ...], step_px: int) -> Correspondences:
    """A grid of good correspondences, `step_px` apart.

    Raises:
        ImageError: too little of the wall is lit or decodes smoothly.
    """
    rows, cols = decoded.lit.shape
    y, x = np.mgrid[step_px : rows - step_px : step_px, step_px : cols - step_px : step_px]
    camera = np.stack([x.ravel(), y.ravel()], axis=1).astype(float)
    projector, good, _ = on_panel(decoded, edges, camera, max(step_px // 2, 5))
    if good.sum() < MINIMUM_POINTS:
        raise ImageError(
            f"Only {good.sum()} of {len(camera)} places on the wall decode smoothly; expected at least "
            f"{MINIMUM_POINTS}. Retake the wall sequence: darken the room, aim the projector at what the "
            "camera sees, avoid saturation and movement."
        )
    return Correspondences(camera[good], projector[good])


def triangulate(
    camera: Device, projector: Device, seen: Correspondences
) -> tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, " points"]]:
    """Points in the camera's frame [m] and the gap between the two rays of each [m].

    Raises:
        ImageError: camera and projector in one place.
    """
    rotation, _ = cv2.Rodrigues(projector.rotation_rad)
    origin = -rotation.T @ projector.translation_m
    a = undistorted(camera, seen.camera_px)
    b = undistorted(projector, seen.projector_px) @ rotation
    # Feet of the common perpendicular: minimise |s a - (origin + t b)|^2 for each pair.
    aa, ab, bb = (np.einsum("ij,ij->i", u, v) for u, v in ((a, a), (a, b), (b, b)))
    ao, bo = a @ origin, b @ origin
    determinant = aa * bb - ab**2
    if np.median(determinant / (aa * bb)) < _LEAST_PARALLAX:
        raise ImageError(
            "The rays of camera and projector are parallel: both stand in one place, or were calibrated so. "
            "Move them apart by a tenth of the distance to the wall, and calibrate again."
        )
    # A lone parallel pair lands far away, where the plane's fit leaves it out.
    determinant = np.maximum(determinant, _LEAST_PARALLAX * aa * bb)
    s = (bb * ao - ab * bo) / determinant
    t = (ab * ao - aa * bo) / determinant
    on_a, on_b = s[:, None] * a, origin + t[:, None] * b
    return (on_a + on_b) / 2, np.linalg.norm(on_a - on_b, axis=1)


def fit_plane(points_m: Float[np.ndarray, "points 3"]) -> Plane:
    """The plane through the points, outliers (things in front of the wall) left out.

    Raises:
        ImageError: fewer than three points, or points on one line.
    """
    if len(points_m) < 3:
        raise ImageError(f"A wall of {len(points_m)} points; expected at least 3, better hundreds.")
    spread = np.linalg.svd(points_m - points_m.mean(axis=0), compute_uv=False)
    if not spread[1] > 1e-9 * spread[0]:
        raise ImageError(
            "The wall's points lie on a line, which holds no plane. Light and see more of the wall."
        )
    plane = _least_squares(points_m, _consensus(points_m))
    for _ in range(10):
        distance = points_m @ plane.normal - plane.offset_m
        inliers = np.abs(distance) <= 3.0 * max(plane.flatness_rms_m, 1e-12)
        if (inliers == plane.inliers).all():
            break
        plane = _least_squares(points_m, inliers)
    return plane


def _least_squares(points_m: Float[np.ndarray, "points 3"], inliers: Bool[np.ndarray, " points"]) -> Plane:
    centre = points_m[inliers].mean(axis=0)
    normal = np.linalg.svd(points_m[inliers] - centre, full_matrices=False)[2][2]
    normal *= np.sign(normal @ centre) or 1.0
    rms = float(np.sqrt(np.mean(((points_m[inliers] - centre) @ normal) ** 2)))
    return Plane(normal, float(normal @ centre), rms, centre, inliers)


def undistorted(device: Device, pixels_px: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 3"]:
    """Directions in the device's frame, with z = 1."""
    return directions(device.matrix, device.intrinsics[4:], np.asarray(pixels_px, float))


def _consensus(points_m: Float[np.ndarray, "points 3"]) -> Bool[np.ndarray, " points"]:
    """Points near the plane through three of them that most others support by the median (seeded)."""
    rng = np.random.default_rng(0)
    best, best_median = np.ones(len(points_m), bool), np.inf
    for _ in range(200):
        a, b, c = points_m[rng.choice(len(points_m), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal)
        if length < 1e-12:
            continue
        distance = np.abs((points_m - a) @ (normal / length))
        median = float(np.median(distance))
        if median < best_median:
            best, best_median = distance <= 4.5 * max(median, 1e-9), median
    return best
