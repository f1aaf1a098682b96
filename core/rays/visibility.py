"""Which pixels see the back wall, and which lie beyond it, where no air of the room moves the picture."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from core.rays.optics import pinhole
from core.scene import Scene


def sees_wall(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"], margin_px: float
) -> Bool[np.ndarray, " points"]:
    """Whether pixels (column, row) see the back wall at least `margin_px` inside its edges.

    A negative margin asks for the wall and a strip around it.
    """
    point, range_m = _on_the_wall(scene, view, pixels)
    return _inside(
        scene, point, margin_px * range_m / min(scene.views[view].camera.focal_px) * np.ones((2, 1))
    )


def away_from_walls(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"], share: float
) -> Bool[np.ndarray, " points"]:
    """Whether pixels see the back wall at least `share` of the room's size inside its edges."""
    size_m = np.asarray(scene.room.size_m)[[0, 2]]
    return _inside(scene, _on_the_wall(scene, view, pixels)[0], share * size_m[:, None])


def _on_the_wall(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"]
) -> tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, " points"]]:
    """Where each pixel looks on the plane of the back wall, and from how far; NaN where it looks away."""
    with jax.enable_x64(True):
        lens = pinhole(scene.views[view].camera)
        direction = np.asarray(jax.vmap(lens.direction)(jnp.asarray(pixels, jnp.float64)))
        origin = np.asarray(lens.position_m)
    forward = np.where(direction[:, 1] > 1e-9, direction[:, 1], np.nan)
    range_m = (scene.room.upper_m[1] - origin[1]) / forward
    return origin + range_m[:, None] * direction, range_m


def _inside(
    scene: Scene, point: Float[np.ndarray, "points 3"], margin_m: Float[np.ndarray, "2 _"]
) -> Bool[np.ndarray, " points"]:
    """Points that lie on the back wall, so far from its edges along x and z."""
    inside = np.ones(len(point), bool)
    for axis, gap_m in zip((0, 2), margin_m, strict=True):
        inside &= point[:, axis] >= scene.room.lower_m[axis] + gap_m
        inside &= point[:, axis] <= scene.room.upper_m[axis] - gap_m
    return inside
