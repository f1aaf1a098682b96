"""What the calibration's uncertainty does to the shift that the solver sees, in pixels.

For a camera pixel q, the wall point X(q) and the panel position p(X) follow from the calibration. Two
effects, each by the derivative with the parameters and their joint covariance:

    placement   the pattern's predicted position in the picture errs by dq = (dp/dq)^-1 (dp/dparameters)
    shift       a ray turned by an angle half-way to the wall moves the picture by one pixel; with other
                parameters the same turn moves it by 1 + error

Placement matters where a rendered reference is compared with the captured one; the shift's relative error
is all that remains where reference and flow are both captured. Derivatives by JAX in float64.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from calibration.bundle import OPTICS_PARAMETERS, Bundle
from calibration.errors import BundleError
from core.geometry import Optics
from core.rays.optics import Pinhole, pinhole

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
    with jax.enable_x64(True):
        placement, shift = _slopes(optics, lit.optics if lit else None, wall_y_m, pixels)
    return ShiftUncertainty(pixels, _std(placement, covariance), _std(shift, covariance))


def _slopes(
    camera: Optics, projector: Optics | None, wall_y_m: float, pixels: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (pixels, 2, parameters) of the pattern's place and of a 1 px shift along either axis."""
    eye = pinhole(camera)
    lamp = None if projector is None else pinhole(projector)
    nothing = jnp.zeros(2 * _SIZE)

    def pattern(pixel: Array, change: Array) -> Array:
        point = _wall_point(_changed(eye, change[:_SIZE]), pixel, wall_y_m)
        return point[jnp.array([0, 2])] if lamp is None else _changed(lamp, change[_SIZE:]).project(point)

    def placement(pixel: Array) -> Array:
        if lamp is None:
            return jnp.zeros((2, 2 * _SIZE))
        return jnp.linalg.solve(jax.jacfwd(pattern)(pixel, nothing), jax.jacfwd(pattern, 1)(pixel, nothing))

    def shift(pixel: Array) -> Array:
        middle = (eye.position_m + _wall_point(eye, pixel, wall_y_m)) / 2
        unit = jnp.linalg.inv(_by_turn(eye, pixel, middle, wall_y_m))
        moved = jax.jacfwd(lambda c: _by_turn(_changed(eye, c[:_SIZE]), pixel, middle, wall_y_m) @ unit)(
            nothing
        )
        # The larger of the two axes' own errors stands for both: (axis, parameter) from the diagonal.
        return jnp.stack([moved[0, 0], moved[1, 1]])

    batch = jnp.asarray(pixels)
    return np.asarray(jax.vmap(placement)(batch)), np.asarray(jax.vmap(shift)(batch))


def _by_turn(eye: Pinhole, pixel: Array, middle: Array, wall_y_m: float) -> Float[Array, "2 2"]:
    """Pixels that a wall point moves by, per turn [rad] of its ray at `middle` about two axes."""
    direction = eye.direction(pixel)
    across = jnp.stack([jnp.cross(direction, axis) for axis in jnp.eye(3)[jnp.array([2, 0])]])

    def seen(turn: Array) -> Array:
        bent = direction + turn @ across
        point = middle + bent * (wall_y_m - middle[1]) / bent[1]
        return eye.project(point)

    return jax.jacfwd(seen)(jnp.zeros(2))


def _wall_point(eye: Pinhole, pixel: Array, wall_y_m: float) -> Float[Array, "3"]:
    direction = eye.direction(pixel)
    return eye.position_m + direction * (wall_y_m - eye.position_m[1]) / direction[1]


def _changed(optics: Pinhole, change: Float[Array, "15"]) -> Pinhole:
    """The optics with their parameters changed, in the order of `OPTICS_PARAMETERS`."""
    wx, wy, wz = change[9:12]
    zero = jnp.zeros_like(wx)
    turn = jnp.stack([zero, -wz, wy, wz, zero, -wx, -wy, wx, zero]).reshape(3, 3)
    return Pinhole(
        focal_px=optics.focal_px + change[:2],
        principal_px=optics.principal_px + change[2:4],
        position_m=optics.position_m + change[12:15],
        rotation=optics.rotation + turn @ optics.rotation,
        distortion=optics.distortion + change[4:9],
        distorted=True,
    )


def _std(slopes: np.ndarray, covariance: np.ndarray) -> Float[np.ndarray, " pixels"]:
    """The larger standard deviation of the two axes."""
    variance = np.einsum("pai,ij,paj->pa", slopes, covariance, slopes)
    return np.sqrt(np.maximum(variance, 0.0)).max(axis=1)
