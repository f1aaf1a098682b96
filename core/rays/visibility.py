"""Which pixels see the back wall, and which lie beyond it, where no air of the room moves the picture."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from core.lens import sees_along
from core.objects import RoomObject
from core.rays.optics import pinhole
from core.scene import Marks, ProjectedPattern, Scene
from core.view_frame import facing, turn_of

# Air so near to an object is in a layer that a room's grid does not resolve: rays through it are left out.
_SKIN_M = 0.05


def sees_wall(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"], margin_px: float
) -> Bool[np.ndarray, " points"]:
    """Whether pixels (column, row) see the back wall at least `margin_px` inside its edges.

    A negative margin asks for the wall and a strip around it. Else what an object or marks hide is not seen, and no
    ray passes an object by less than the margin.
    """
    scene, view = facing(scene, view)
    point, range_m = _on_the_wall(scene, view, pixels)
    inside = _inside(
        scene, point, margin_px * range_m / min(scene.views[view].camera.focal_px) * np.ones((2, 1))
    )
    if margin_px < 0:
        return inside
    shown = inside & ~hidden_by_objects(scene, view, pixels, margin_px)
    for marks in scene.views[view].marks:
        shown &= ~within_marks(marks, pixels, -margin_px)
    return shown


def within_marks(
    marks: Marks, pixels: Float[np.ndarray, "points 2"], margin_px: float
) -> Bool[np.ndarray, " points"]:
    """Whether pixels (column, row) lie in the marks' rectangle, so far inside its edges; below 0: around it."""
    low, high = np.array(marks.lower_px) + margin_px, np.array(marks.upper_px) - margin_px
    return np.all((pixels >= low) & (pixels <= high), axis=1)


def hidden_by_objects(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"], margin_px: float
) -> Bool[np.ndarray, " points"]:
    """Whether an object stands between the camera and the back wall, or in the projector's light to that point.

    `margin_px`: objects count as so much larger, as the camera sees that length on the wall.
    """
    scene, view = facing(scene, view)
    hidden = np.zeros(len(pixels), bool)
    if scene.objects:
        margin_m = margin_px * _least_range_m(scene, view) / min(scene.views[view].camera.focal_px)
        hidden = _behind_objects(scene, view, pixels, margin_m)
    return hidden


def away_from_walls(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"], share: float
) -> Bool[np.ndarray, " points"]:
    """Whether pixels see the back wall at least `share` of the room's size inside its edges, and past objects."""
    scene, view = facing(scene, view)
    size_m = np.asarray(scene.room.size_m)[[0, 2]]
    inside = _inside(scene, _on_the_wall(scene, view, pixels)[0], share * size_m[:, None])
    return inside & ~_behind_objects(scene, view, pixels, _SKIN_M) if scene.objects else inside


def _least_range_m(scene: Scene, view: int) -> float:
    return scene.room.upper_m[1] - scene.views[view].camera.position_m[1]


def _behind_objects(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"], margin_m: float
) -> Bool[np.ndarray, " points"]:
    point_m, _ = _on_the_wall(scene, view, pixels)
    lights_m = [scene.views[view].camera.position_m]
    if isinstance(scene.light, ProjectedPattern):
        lights_m.append(scene.light.projector.position_m)
    hidden = np.zeros(len(pixels), bool)
    for item in scene.objects:
        for from_m in lights_m:
            hidden |= np.isfinite(first_hit(item, np.array(from_m, float), point_m, margin_m))
    return hidden


def wall_points(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"]
) -> Float[np.ndarray, "points 3"]:
    """Where each pixel looks on the plane of its view's wall [m]; NaN where it looks away."""
    point_m, _ = _on_the_wall(*facing(scene, view), pixels)
    return point_m @ turn_of(scene, view).matrix


def first_hit(
    item: RoomObject,
    from_m: Float[np.ndarray, "3"],
    to_m: Float[np.ndarray, "points 3"],
    margin_m: float = 0.0,
) -> Float[np.ndarray, " points"]:
    """Where the way from one point to others enters an object, as a share of the way; NaN where it does not."""
    way = to_m - from_m
    way = np.where(np.abs(way) < 1e-12, 1e-12, way)
    low = (np.array(item.lower_m) - margin_m - from_m) / way
    high = (np.array(item.upper_m) + margin_m - from_m) / way
    enters, leaves = np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
    # A thing against the wall still hides it.
    met = (enters < leaves) & (leaves > 0.0) & (enters < 1.0)
    return np.where(met, enters, np.nan)


def _on_the_wall(
    scene: Scene, view: int, pixels: Float[np.ndarray, "points 2"]
) -> tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, " points"]]:
    """Where each pixel looks on the plane of the back wall, and from how far; NaN where it looks away.

    NaN too where the lens's distortion has no direction for a pixel.
    """
    with jax.enable_x64(True):
        lens = pinhole(scene.views[view].camera)
        direction = np.asarray(jax.vmap(lens.direction)(jnp.asarray(pixels, jnp.float64)))
        origin = np.asarray(lens.position_m)
    ahead = (direction[:, 1] > 1e-9) & sees_along(scene.views[view].camera, pixels)
    forward = np.where(ahead, direction[:, 1], np.nan)
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
