"""Straight rays on a vertex grid as a linear map: excess refractivity -> displacement on the sensor.

With y along the view, slopes p = d_x / d_y and q = d_z / d_y, Y the back wall, y0 the entry, and
m = (N - N0) / (1 + N0), the first-order wall shift slid along the ray onto the wall is

    shift_x = (1 + p^2 + q^2) [ (1 + p^2) Gx + p q Gz - p E ]        shift_z likewise,
    Gx = int (Y - y) dm/dx dy,   Gz = int (Y - y) dm/dz dy,   E = int m dy - (Y - y0) m(y0)

(the y-derivative of m is integrated by parts). The integrals run over y0 ... Y; m is linear in y between
the grid's y-planes, where it is bilinear in x and z, as in `GridField`. On each plane the ray's own
place is used: exact for rays along y; a tilted ray sees each cell's x-slope at the plane and not
half-way to the next, an error of first order in slope x plane spacing / cell.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from core.geometry import Box
from core.rays.bundle import RayOutcome, clip_ray
from core.rays.optics import pinhole
from core.scene import ProjectedPattern, Scene
from core.setting import SettingError


class StraightRayOperator(eqx.Module):
    """displacement_px = A excess: the motion of the pattern that the camera sees, (column, row).

    Each ray takes four vertices on every y-plane. Pass it into jitted functions as an argument: closed
    over, its weights become constants of the program.
    """

    shape: tuple[int, int, int] = eqx.field(static=True)
    vertex: tuple[Int[Array, "windows planes"], ...]
    weight_px: tuple[Float[Array, "windows planes 2 4"], ...]

    def apply(self, excess: Float[Array, "nx ny nz"]) -> Float[Array, "windows 2"]:
        """Displacement [px] of each pixel for N - N0 on the vertices."""
        flat = jnp.asarray(excess).reshape(-1)
        steps = (0, 1, self.shape[1] * self.shape[2], self.shape[1] * self.shape[2] + 1)
        total = jnp.zeros((self.vertex[0].shape[0], 2), flat.dtype)
        for vertex, weight in zip(self.vertex, self.weight_px, strict=True):
            corners = jnp.stack([flat.at[vertex + s].get(mode="promise_in_bounds") for s in steps], -1)
            total = total + jnp.einsum("wpic,wpc->wi", weight, corners)
        return total

    def transpose(self, displacement: Float[Array, "windows 2"]) -> Float[Array, "nx ny nz"]:
        """A^T: the gradient with respect to N - N0 of a loss with this gradient in the displacement."""
        example = jax.ShapeDtypeStruct(self.shape, displacement.dtype)
        return jax.linear_transpose(self.apply, example)(displacement)[0]


def build(
    scene: Scene, view: int, pixels: Float[np.ndarray, "windows 2"], shape: tuple[int, int, int]
) -> StraightRayOperator:
    """The operator of a view for pixels (column, row) and a vertex grid of the room.

    The projector's own refraction is included when the light is a projector. A pixel that does not see
    the back wall, or sees a point that the projector cannot reach, gets zero weights.
    Raises SettingError for fewer than two vertices on an axis.
    """
    if min(shape) < 2:
        raise SettingError(f"The grid has shape {shape}; expected at least 2 vertices on every axis.")
    with jax.enable_x64(True):
        lens = pinhole(scene.views[view].camera)
        points_m, image_px_m, seen = (
            np.asarray(a) for a in _wall(scene.room, lens, jnp.asarray(np.asarray(pixels, np.float64)))
        )
        image_px_m = -image_px_m / (1.0 + scene.air.ambient_refractivity)
        paths = [(np.asarray(lens.position_m), image_px_m)]
        if isinstance(scene.light, ProjectedPattern):
            paths.append((np.array(scene.light.projector.position_m, float), -image_px_m))
            seen = seen & np.asarray(_reaches(scene.room, jnp.asarray(paths[1][0]), jnp.asarray(points_m)))
        parts = [
            _weights(scene.room, shape, origin, points_m, jacobian * seen[:, None, None])
            for origin, jacobian in paths
        ]
    vertex = tuple(jnp.asarray(v, jnp.int32) for v, _ in parts)
    return StraightRayOperator(shape, vertex, tuple(jnp.asarray(w, jnp.float32) for _, w in parts))


@eqx.filter_jit
@partial(jax.vmap, in_axes=(None, None, 0))
def _wall(room: Box, lens, pixel: Float[Array, "2"]):
    """Wall point of a pixel, d pixel / d (x, z) on the wall, and whether it is on the wall."""
    direction = lens.direction(pixel)
    _, _, outcome = clip_ray(room, lens.position_m, direction)
    seen = outcome == RayOutcome.wall
    forward = jnp.where(seen, direction[1], 1.0)
    point_m = lens.position_m + (room.upper_m[1] - lens.position_m[1]) / forward * direction
    point_m = jnp.where(seen, point_m, jnp.asarray(room.centre_m).at[1].set(room.upper_m[1]))
    return point_m, jax.jacfwd(lens.project)(point_m)[:, jnp.asarray([0, 2])], seen


@eqx.filter_jit
@partial(jax.vmap, in_axes=(None, None, 0))
def _reaches(room: Box, origin_m: Float[Array, "3"], point_m: Float[Array, "3"]):
    towards = point_m - origin_m
    _, _, outcome = clip_ray(room, origin_m, towards / jnp.linalg.norm(towards))
    return outcome == RayOutcome.wall


def _weights(
    room: Box, shape: tuple[int, int, int], origin_m: np.ndarray, points_m: np.ndarray, px_per_m: np.ndarray
) -> tuple[Int[np.ndarray, "windows planes"], Float[np.ndarray, "windows planes 2 4"]]:
    """Lowest vertex and weights of the rays from `origin_m` to the wall points, on every y-plane."""
    lower, upper = np.array(room.lower_m), np.array(room.upper_m)
    spacing = (upper - lower) / (np.array(shape) - 1)
    slope = (points_m - origin_m) / (points_m[:, 1:2] - origin_m[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        # Where the ray enters the room, as y: the last of its three entries.
        sides = np.where(slope > 0, lower, upper)
        enters = origin_m[1] + (sides - origin_m) / slope
    enters[:, 1] = max(lower[1], origin_m[1])
    entry_y = np.clip(np.nanmax(np.where(np.isfinite(enters), enters, -np.inf), axis=1), lower[1], upper[1])
    lever, plain, at_entry = _moments(lower[1], upper[1], shape[1], entry_y)
    plane_y = np.linspace(lower[1], upper[1], shape[1])
    place = (
        points_m[:, None, :]
        - slope[:, None, :] * (upper[1] - np.clip(plane_y, entry_y[:, None], None))[..., None]
    )
    cell, fraction = [], []
    for axis in (0, 2):
        position = (place[..., axis] - lower[axis]) / spacing[axis]
        cell.append(np.clip(np.floor(position).astype(int), 0, shape[axis] - 2))
        fraction.append(np.clip(position - cell[-1], 0.0, 1.0))
    (fx, fz), p, q = fraction, slope[:, 0], slope[:, 2]
    along_x, along_z = np.stack([1 - fx, fx], -1), np.stack([1 - fz, fz], -1)
    step = np.array([-1.0, 1.0])
    value = along_x[..., :, None] * along_z[..., None, :]
    slope_x = step[:, None] / spacing[0] * along_z[..., None, :]
    slope_z = along_x[..., :, None] * step / spacing[2]
    edge = (plain - (upper[1] - entry_y)[:, None] * at_entry)[..., None, None] * value
    gx, gz = lever[..., None, None] * slope_x, lever[..., None, None] * slope_z
    p, q = p[:, None, None, None], q[:, None, None, None]
    stretch = 1 + p**2 + q**2
    shift = np.stack(
        [
            stretch * ((1 + p**2) * gx + p * q * gz - p * edge),
            stretch * ((1 + q**2) * gz + p * q * gx - q * edge),
        ],
        axis=2,
    ).reshape(*fx.shape, 2, 4)
    vertex = (cell[0] * shape[1] + np.arange(shape[1])) * shape[2] + cell[1]
    return vertex, np.einsum("wij,wpjc->wpic", px_per_m, shift)


def _moments(
    lower_m: float, upper_m: float, planes: int, entry_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """int (Y - y) hat_j dy, int hat_j dy from the entry to Y, and hat_j(entry), each (windows, planes)."""
    edges = np.linspace(lower_m, upper_m, planes)
    low = np.maximum(edges[:-1], entry_m[:, None])
    width = np.maximum(edges[1:] - low, 0.0)
    lever, plain, at_entry = (np.zeros((len(entry_m), planes)) for _ in range(3))
    # Two Gauss points a slab: exact for the product of two linear functions.
    for node in (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)):
        y = low + node * width
        share = (y - edges[:-1]) / (edges[1] - edges[0])
        for side, hat in ((slice(0, -1), 1 - share), (slice(1, None), share)):
            lever[:, side] += 0.5 * width * hat * (upper_m - y)
            plain[:, side] += 0.5 * width * hat
    share = np.clip(1 - np.abs(entry_m[:, None] - edges) / (edges[1] - edges[0]), 0.0, 1.0)
    at_entry += share
    return lever, plain, at_entry
