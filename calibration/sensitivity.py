"""What the calibration's uncertainty does to the shift that the solver sees, in pixels.

For a camera pixel q, the wall point X(q) and the panel position p(X) follow from the calibration. Two
effects, each by the derivative with the parameters and their joint covariance:

    placement   the pattern's predicted position in the picture errs by dq = (dp/dq)^-1 (dp/dparameters)
    shift       a ray turned by an angle half-way to the wall moves the picture by one pixel; with other
                parameters the same turn moves it by 1 + error

Placement matters where a rendered reference is compared with the captured one; the shift's relative error
is all that remains where reference and flow are both captured. Derivatives by central
differences in float64.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from calibration.bundle import OPTICS_PARAMETERS, Bundle
from calibration.errors import BundleError
from calibration.simulated_pictures import rays_of
from calibration.world import shifted
from core.geometry import Optics

_SIZE = len(OPTICS_PARAMETERS)


@dataclass(frozen=True)
class ShiftUncertainty:
    """At `pixels_px`: standard deviations of the pattern's place [px] and of a shift of 1 px [px]."""

    pixels_px: Float[np.ndarray, "pixels 2"]
    placement_std_px: Float[np.ndarray, " pixels"]
    shift_std_per_px: Float[np.ndarray, " pixels"]


def shift_uncertainty(bundle: Bundle, camera: str | None = None, steps: int = 9) -> ShiftUncertainty:
    """The effect of the covariances on a grid of `steps` x `steps` pixels.

    Without a projector the pattern is on the wall itself and has no placement error of its own.

    Raises:
        BundleError: no camera or no wall in the bundle.
    """
    seeing = bundle.camera(camera)
    if bundle.wall is None:
        raise BundleError("The calibration has no wall; run 'airlens calibrate wall'.")
    optics = seeing.optics
    x = (np.arange(steps) + 0.5) / steps * optics.width_px - 0.5
    y = (np.arange(steps) + 0.5) / steps * optics.height_px - 0.5
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    wall_y_m = bundle.wall.point_m[1]
    lit = bundle.projector
    covariance = np.zeros((2 * _SIZE, 2 * _SIZE))
    covariance[:_SIZE, :_SIZE] = seeing.covariance_matrix()
    if lit is not None:
        covariance[_SIZE:, _SIZE:] = lit.covariance_matrix()
        # The projector errs together with the first camera only.
        if seeing == bundle.cameras[0]:
            cross = lit.cross_covariance_matrix()
            covariance[_SIZE:, :_SIZE], covariance[:_SIZE, _SIZE:] = cross, cross.T
    lamp = lit.optics if lit else None
    placement = _placement_slopes(optics, lamp, wall_y_m, pixels)
    shift = _shift_slopes(optics, wall_y_m, pixels)
    return ShiftUncertainty(pixels, _std(placement, covariance), _std(shift, covariance[:_SIZE, :_SIZE]))


def _placement_slopes(
    camera: Optics, projector: Optics | None, wall_y_m: float, pixels: np.ndarray
) -> Float[np.ndarray, "pixels 2 parameters"]:
    """How far the pattern's picture moves, by each parameter of camera and projector."""
    if projector is None:
        return np.zeros((len(pixels), 2, 2 * _SIZE))

    def panel(eye: Optics, lamp: Optics, at: np.ndarray) -> np.ndarray:
        return _project(lamp, _wall_points(eye, at, wall_y_m))

    by_pixel = np.stack(
        [
            (panel(camera, projector, pixels + d) - panel(camera, projector, pixels - d)) / 0.02
            for d in 0.01 * np.eye(2)
        ],
        axis=2,
    )
    columns = [
        (panel(shifted(camera, d), projector, pixels) - panel(shifted(camera, -d), projector, pixels))
        / (2 * s)
        for d, s in _changes()
    ]
    columns += [
        (panel(camera, shifted(projector, d), pixels) - panel(camera, shifted(projector, -d), pixels))
        / (2 * s)
        for d, s in _changes()
    ]
    return np.linalg.solve(by_pixel, np.stack(columns, axis=2))


def _shift_slopes(
    camera: Optics, wall_y_m: float, pixels: np.ndarray
) -> Float[np.ndarray, "pixels 2 parameters"]:
    """Relative change of each axis' shift, by each parameter of the camera."""
    middles = (np.array(camera.position_m) + _wall_points(camera, pixels, wall_y_m)) / 2
    unit = np.linalg.inv(_by_turn(camera, pixels, middles, wall_y_m))
    columns = []
    for d, s in _changes():
        ends = [_by_turn(shifted(camera, sign * d), pixels, middles, wall_y_m) for sign in (1.0, -1.0)]
        relative = (ends[0] - ends[1]) / (2 * s) @ unit
        # The diagonal: what a shift along an axis errs by along itself.
        columns.append(np.stack([relative[:, 0, 0], relative[:, 1, 1]], axis=1))
    return np.stack(columns, axis=2)


def _by_turn(
    camera: Optics, pixels: np.ndarray, middles: np.ndarray, wall_y_m: float
) -> Float[np.ndarray, "pixels 2 2"]:
    """Pixels that the wall point moves by, per turn [rad] of the ray at its middle, about two axes."""
    direction = rays_of(camera, pixels)
    step_rad, columns = 1e-5, []
    for axis in (np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])):
        ends = []
        for sign in (1.0, -1.0):
            bent = direction + sign * step_rad * np.cross(direction, axis)
            reach = (wall_y_m - middles[:, 1]) / bent[:, 1]
            ends.append(_project(camera, middles + reach[:, None] * bent))
        columns.append((ends[0] - ends[1]) / (2 * step_rad))
    return np.stack(columns, axis=2)


def _wall_points(camera: Optics, pixels: np.ndarray, wall_y_m: float) -> Float[np.ndarray, "pixels 3"]:
    direction = rays_of(camera, pixels)
    origin = np.array(camera.position_m)
    return origin + direction * ((wall_y_m - origin[1]) / direction[:, 1])[:, None]


def _project(optics: Optics, points_m: np.ndarray) -> Float[np.ndarray, "points 2"]:
    (fx, fy), (cx, cy) = optics.focal_px, optics.principal_px
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    local = (points_m - np.array(optics.position_m)) @ optics.rotation.T
    pixels, _ = cv2.projectPoints(local, np.zeros(3), np.zeros(3), matrix, np.array(optics.distortion))
    return np.asarray(pixels, float).reshape(-1, 2)


def _changes() -> list[tuple[np.ndarray, float]]:
    """A small change of each parameter alone, and its size."""
    sizes = np.array([1e-2] * 4 + [1e-5] * 5 + [1e-6] * 3 + [1e-5] * 3)
    return [(step * unit, float(step)) for step, unit in zip(sizes, np.eye(_SIZE), strict=True)]


def _std(slopes: np.ndarray, covariance: np.ndarray) -> Float[np.ndarray, " pixels"]:
    """The larger standard deviation of the two axes."""
    variance = np.einsum("pai,ij,paj->pa", slopes, covariance, slopes)
    return np.sqrt(np.maximum(variance, 0.0)).max(axis=1)
