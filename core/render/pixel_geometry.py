"""What a pixel sees when nothing flows, in float64 once a scene; what remains is small and float32.

    pattern coordinate = cell + fraction      (integer + float32)
    moved by           (J delta) / (1 + g . delta)      exact for a projective map of the wall

so a shift of 1e-6 px survives on a panel of 4096 px.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from core.rays.bundle import RayOutcome, Rays, clip_ray, corners_of
from core.rays.optics import Pinhole, pinhole
from core.render.light import AbstractPatternMap, ProjectorMap, coordinate_jacobian, pattern_map
from core.scene import Scene
from core.setting import SettingError


class PixelGeometry(eqx.Module):
    """Sensor positions, one or a batch: rays, undisturbed pattern coordinates and their derivatives.

    `projector` are the rays that light the wall points which the camera's straight rays reach;
    `projector_range_m` their length from the lens; both None for a print. `weight` is the paper's
    cos / r, relative to the wall point nearest to the camera; 0 where no pattern is seen.
    """

    camera: Rays
    cell: Int[Array, "*rays 2"]
    fraction_px: Float[Array, "*rays 2"]
    pattern_from_wall: Float[Array, "*rays 2 3"]
    depth_slope: Float[Array, "*rays 3"]
    pattern_from_pixel: Float[Array, "*rays 2 2"]
    weight: Float[Array, "*rays"]
    projector: Rays | None = None
    projector_range_m: Float[Array, "*rays"] | None = None


def pixel_geometry(
    scene: Scene,
    view: int,
    pixels: Float[np.ndarray, "rays 2"],
    lens_point_m: tuple[float, float] = (0.0, 0.0),
) -> PixelGeometry:
    """Geometry of sensor positions (column, row), float32 out of float64. Cost: below 1 us a position.

    `lens_point_m` is the place on the aperture, along the sensor's columns and rows, from which the camera
    ray leaves for the wall point: the camera is focused on the wall. The view is in its own frame
    (`core.view_frame`). Raises SettingError for one that is not.
    """
    eye = scene.views[view]
    if eye.wall != "y_max" or eye.light is not None:
        raise SettingError(
            f"View {eye.name!r} looks at {eye.wall} or by a light of its own; rays are traced to y_max and by the "
            "scene's light alone here. Take data_term = 'displacement', or the preset draft or standard."
        )
    many = filled(np.asarray(pixels, np.float64))
    with jax.enable_x64(True):
        found = _batch(
            corners_of(scene.room),
            pinhole(scene.views[view].camera),
            pattern_map(scene),
            jnp.asarray(many),
            jnp.asarray(np.array(lens_point_m, np.float64)),
        )
    if len(many) == len(pixels):
        return found
    # Cut by NumPy: JAX would compile a program for each number of pixels.
    return jax.tree.map(lambda of: jnp.asarray(np.asarray(of)[: len(pixels)]), found)


def filled(pixels: Float[np.ndarray, "pixels 2"]) -> Float[np.ndarray, "more 2"]:
    """The last pixel again, up to `shared_count`: pictures of other sizes run the same compiled programs."""
    return np.pad(pixels, ((0, shared_count(len(pixels)) - len(pixels)), (0, 0)), mode="edge")


def shared_count(count: int) -> int:
    """The least number, not below `count`, that is a power of two or one and a half times one."""
    power = 1 << (count - 1).bit_length() if count else 0
    return 3 * power // 4 if 4 * count <= 3 * power else power


@eqx.filter_jit
def _batch(
    corners_m: Float[Array, "2 3"],
    lens: Pinhole,
    light: AbstractPatternMap,
    pixels: Float[Array, "rays 2"],
    lens_point_m: Float[Array, "2"],
) -> PixelGeometry:
    wide = jax.vmap(lambda pixel: _one(corners_m, lens, light, pixel, lens_point_m))(pixels)
    return jax.tree.map(lambda a: a.astype(jnp.float32 if eqx.is_inexact_array(a) else jnp.int32), wide)


def _one(
    corners_m: Float[Array, "2 3"],
    lens: Pinhole,
    light: AbstractPatternMap,
    pixel: Float[Array, "2"],
    lens_point_m: Float[Array, "2"],
) -> PixelGeometry:
    direction = lens.direction(pixel)
    point_m, range_m = _wall_point(corners_m, lens, pixel)
    eye_m = lens.position_m + lens_point_m @ lens.rotation[:2]
    towards = range_m * direction - lens_point_m @ lens.rotation[:2]
    camera = Rays(*_clipped(corners_m, eye_m, towards / jnp.linalg.norm(towards)))
    coordinate = light.coordinate_px(point_m)
    cell = jnp.round(coordinate)
    nearest_m = corners_m[1, 1] - lens.position_m[1]
    projector, projector_range_m, lit = None, None, camera.outcome == RayOutcome.wall
    if isinstance(light, ProjectorMap):
        towards = point_m - light.optics.position_m
        projector_range_m = jnp.linalg.norm(towards)
        projector = Rays(*_clipped(corners_m, light.optics.position_m, towards / projector_range_m))
        lit = lit & (projector.outcome == RayOutcome.wall) & (light.optics.depth_m(point_m) > 0)
    limit = 2**30
    return PixelGeometry(
        camera=camera,
        cell=jnp.where(lit, jnp.clip(cell, -limit, limit), 0.0).astype(jnp.int32),
        fraction_px=jnp.where(lit, coordinate - cell, 0.0),
        pattern_from_wall=jnp.where(lit, coordinate_jacobian(light, point_m), 0.0),
        depth_slope=jnp.where(lit, light.depth_slope(point_m), 0.0),
        pattern_from_pixel=jnp.where(
            lit, jax.jacfwd(lambda p: light.coordinate_px(_wall_point(corners_m, lens, p)[0]))(pixel), 0.0
        ),
        weight=jnp.where(lit, direction[1] * nearest_m / range_m, 0.0),
        projector=projector,
        projector_range_m=projector_range_m,
    )


def _clipped(
    corners_m: Float[Array, "2 3"], origin_m: Float[Array, "3"], direction: Float[Array, "3"]
) -> tuple:
    entry_m, length_m, outcome = clip_ray(corners_m, origin_m, direction)
    return entry_m, direction, length_m, outcome


def _wall_point(
    corners_m: Float[Array, "2 3"], lens: Pinhole, pixel: Float[Array, "2"]
) -> tuple[Float[Array, "3"], Float[Array, ""]]:
    """Point on the wall's plane and the distance to it; a stand-in for a ray that looks away."""
    direction = lens.direction(pixel)
    forward = jnp.where(direction[1] > 1e-9, direction[1], 1.0)
    range_m = (corners_m[1, 1] - lens.position_m[1]) / forward
    return lens.position_m + range_m * direction, range_m
