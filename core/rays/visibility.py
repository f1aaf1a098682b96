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
    with jax.enable_x64(True):
        lens = pinhole(scene.views[view].camera)
        direction = np.asarray(jax.vmap(lens.direction)(jnp.asarray(pixels, jnp.float64)))
        origin = np.asarray(lens.position_m)
    forward = np.where(direction[:, 1] > 1e-9, direction[:, 1], np.nan)
    range_m = (scene.room.upper_m[1] - origin[1]) / forward
    point = origin + range_m[:, None] * direction
    margin_m = margin_px * range_m / min(scene.views[view].camera.focal_px)
    inside = np.ones(len(pixels), bool)
    for axis in (0, 2):
        inside &= point[:, axis] >= scene.room.lower_m[axis] + margin_m
        inside &= point[:, axis] <= scene.room.upper_m[axis] - margin_m
    return inside
