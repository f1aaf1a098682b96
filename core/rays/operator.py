"""Straight rays on a vertex grid as one linear map: excess refractivity -> displacement on the sensor.

The workhorse of a reconstruction: built once a scene, applied and transposed by matrix products
(`separable`), or by four vertices a plane where paths enter through a side of the room (`gathered`).
Error against finely traced rays: README, *Rays and images*.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from core.geometry import Box
from core.rays.bundle import RayOutcome, clip_ray, corners_of
from core.rays.gathered import gathered_paths
from core.rays.optics import Pinhole, pinhole
from core.rays.paths import AbstractWallPaths, Fan
from core.rays.separable import lattice_through, separable_paths
from core.scene import ProjectedPattern, Scene
from core.setting import SettingError
from core.view_frame import Turn, facing, turn_of


class StraightRayOperator(eqx.Module):
    """displacement_px = A (N - N0): the motion of the pattern that the camera sees, (column, row).

    `shape` is that of the room's vertices; the paths are those of the view's own frame, to which `turn` leads.
    `lit` are the projector's paths, whose shift counts against the camera's; None for a print. Pass an
    operator into jitted functions as an argument: closed over, its matrices become program constants.
    """

    shape: tuple[int, int, int] = eqx.field(static=True)
    turn: Turn = eqx.field(static=True)
    seen: AbstractWallPaths
    lit: AbstractWallPaths | None
    px_per_m: Float[Array, "windows 2 2"]

    def apply(self, excess: Float[Array, "nx ny nz"]) -> Float[Array, "windows 2"]:
        """Displacement [px] of each pixel for N - N0 on the vertices, index order [ix, iy, iz]."""
        excess = self.turn.volume(jnp.asarray(excess))
        shift_m = self.seen.shift_m(excess)
        if self.lit is not None:
            shift_m = shift_m - self.lit.shift_m(excess)
        return jnp.einsum("wij,wj->wi", self.px_per_m, shift_m)

    def transpose(self, displacement: Float[Array, "windows 2"]) -> Float[Array, "nx ny nz"]:
        """A^T: turns a loss's gradient in the displacement into its gradient in N - N0."""
        example = jax.ShapeDtypeStruct(self.shape, displacement.dtype)
        return jax.linear_transpose(self.apply, example)(displacement)[0]

    def chosen(self, rows: Int[Array, " some"]) -> "StraightRayOperator":
        """The operator of some of its pixels, for mini-batches; works on traced indices."""
        lit = None if self.lit is None else self.lit.chosen(rows)
        return StraightRayOperator(self.shape, self.turn, self.seen.chosen(rows), lit, self.px_per_m[rows])


def build(
    scene: Scene,
    view: int,
    pixels: Float[np.ndarray, "windows 2"],
    shape: tuple[int, int, int],
    window_px: float = 0.0,
) -> StraightRayOperator:
    """The operator of a view for pixels (column, row) and a vertex grid of the room.

    The projector's own refraction is included when the light is a projector. With `window_px` the shift is
    averaged over a square window, as a displacement estimate sees it; the slope of the trilinear field,
    which jumps at a cell's faces, is then averaged exactly. A pixel that does not see the back wall, or
    sees a point that the projector cannot reach, gets zero. Raises SettingError for fewer than two vertices
    on an axis, or no pixel.
    """
    if min(shape) < 2:
        raise SettingError(f"The grid has shape {shape}; expected at least 2 vertices on every axis.")
    if len(pixels) == 0:
        raise SettingError(
            f"View {view} has no pixel or window to see the room by. Check that the wall is in the picture."
        )
    turn = turn_of(scene, view)
    scene, own = facing(scene, view)
    with jax.enable_x64(True):
        lens, corners_m = pinhole(scene.views[own].camera), corners_of(scene.room)
        points_m, px_per_m, seen = map(np.asarray, _wall(corners_m, lens, jnp.asarray(pixels, jnp.float64)))
        origins_m = [np.asarray(lens.position_m)]
        if isinstance(scene.light, ProjectedPattern):
            origins_m.append(np.array(scene.light.projector.position_m, float))
            seen = seen & np.asarray(_reaches(corners_m, jnp.asarray(origins_m[1]), jnp.asarray(points_m)))
    footprint_m = window_px / np.median(np.abs(px_per_m[:, [0, 1], [0, 1]]), axis=0)
    paths = [_paths(scene.room, turn.shape(shape), Fan(o, points_m), footprint_m, seen) for o in origins_m]
    # The pattern moves against the shift of the point that is seen.
    px_per_m = -px_per_m * seen[:, None, None] / (1.0 + scene.air.ambient_refractivity)
    lit = paths[1] if len(paths) > 1 else None
    return StraightRayOperator(shape, turn, paths[0], lit, jnp.asarray(px_per_m, jnp.float32))


def _paths(
    room: Box, shape: tuple[int, int, int], fan: Fan, footprint_m: np.ndarray, seen: Bool[np.ndarray, " rays"]
) -> AbstractWallPaths:
    entry_y_m = fan.entry_y_m(room)[seen]
    if entry_y_m.size and np.ptp(entry_y_m) > 1e-9:
        return gathered_paths(room, shape, fan)
    lattice = lattice_through(room, shape, fan.points_m)
    return separable_paths(room, shape, fan.origin_m, lattice, (footprint_m[0], footprint_m[1]))


@eqx.filter_jit
@partial(jax.vmap, in_axes=(None, None, 0))
def _wall(
    corners_m: Float[Array, "2 3"], lens: Pinhole, pixel: Float[Array, "2"]
) -> tuple[Array, Array, Array]:
    """Wall point of a pixel, d pixel / d (x, z) on the wall, and whether it is on the wall."""
    direction = lens.direction(pixel)
    _, _, outcome = clip_ray(corners_m, lens.position_m, direction)
    seen = outcome == RayOutcome.wall
    forward = jnp.where(seen, direction[1], 1.0)
    point_m = lens.position_m + (corners_m[1, 1] - lens.position_m[1]) / forward * direction
    # Any point of the wall stands in for a pixel that misses it: its weights are zero.
    point_m = jnp.where(seen, point_m, corners_m[1])
    return point_m, jax.jacfwd(lens.project)(point_m)[:, jnp.asarray([0, 2])], seen


@eqx.filter_jit
@partial(jax.vmap, in_axes=(None, None, 0))
def _reaches(
    corners_m: Float[Array, "2 3"], origin_m: Float[Array, "3"], point_m: Float[Array, "3"]
) -> Array:
    towards = point_m - origin_m
    _, _, outcome = clip_ray(corners_m, origin_m, towards / jnp.linalg.norm(towards))
    return outcome == RayOutcome.wall
