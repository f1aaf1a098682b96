"""Wall shifts as matrix products, for paths from one origin to a tensor grid of wall points.

On each y-plane the place of a path along x depends on its column alone and along z on its row alone, so

    G = sum_j  X_j V_j Z_j^T          (X_j: columns x nx, V_j: the plane's vertices, Z_j: rows x nz)

Cost of 110 x 110 paths through 64^3 vertices: 0.2 G multiply-adds, in two batched and two plain matrix
products; as much for the transpose. Wall points off a tensor grid (a tilted or distorted camera) are
interpolated from a lattice of half a cell by Catmull-Rom, an error of third order in a quarter of a cell.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from core.geometry import Box
from core.rays.paths import AbstractWallPaths, Fan, plane_moments

_LINES_A_CELL = 2
_SAME_LINE_M = 1e-7
_SMALLEST_HALF_WIDTH = 1e-4


class Lattice(eqx.Module):
    """Lines across the wall and, for each wall point, the crossings it is read from."""

    x_m: Float[np.ndarray, " columns"]
    z_m: Float[np.ndarray, " rows"]
    crossing: Int[np.ndarray, "rays taps"]
    weight: Float[np.ndarray, "rays taps"]


class SeparablePaths(AbstractWallPaths):
    """Paths whose places on every y-plane form a tensor grid."""

    slope_and_edge_x: Float[Array, "columns_2 planes_nx"]
    value_x: Float[Array, "columns planes_nx"]
    value_z: Float[Array, "planes nz rows"]
    slope_z: Float[Array, "planes nz rows"]
    p: Float[Array, "columns 1"]
    q: Float[Array, "1 rows"]
    crossing: Int[Array, "rays taps"]
    weight: Float[Array, "rays taps"]

    def shift_m(self, excess: Float[Array, "nx ny nz"]) -> Float[Array, "rays 2"]:
        """Wall shift along x and z of each path [m]."""
        p, q = self.p, self.q
        value, slope = (
            jnp.einsum("xjz,jzr->jxr", excess, along_z).reshape(-1, q.shape[1])
            for along_z in (self.value_z, self.slope_z)
        )
        gx, edge = jnp.split(self.slope_and_edge_x @ value, 2)
        gz = self.value_x @ slope
        stretch = 1 + p**2 + q**2
        across = stretch * ((1 + p**2) * gx + p * q * gz - p * edge)
        up = stretch * ((1 + q**2) * gz + p * q * gx - q * edge)
        lattice = jnp.stack([across.reshape(-1), up.reshape(-1)], axis=-1)
        taps = lattice.at[self.crossing].get(mode="promise_in_bounds")
        return jnp.sum(taps * self.weight[..., None], axis=1)

    def chosen(self, rows: Int[Array, " some"]) -> "SeparablePaths":
        """The same map for some of the paths; the lattice is still worked out whole."""
        return eqx.tree_at(lambda s: (s.crossing, s.weight), self, (self.crossing[rows], self.weight[rows]))


def separable_paths(
    room: Box,
    shape: tuple[int, int, int],
    origin_m: Float[np.ndarray, "3"],
    lattice: Lattice,
    footprint_m: tuple[float, float],
) -> SeparablePaths:
    """The matrices of all paths from `origin_m`, which enter through the front or start inside.

    `footprint_m` is the size on the wall, along x and z, over which the shift is averaged exactly (the
    window of a displacement estimate); 0 gives the shift of single rays.
    """
    corners = np.array([[lattice.x_m[0], room.upper_m[1], lattice.z_m[0]]])
    lever, edge = (m[0] for m in plane_moments(room, shape[1], Fan(origin_m, corners).entry_y_m(room)))
    value, slope = [], []
    for axis, lines, width_m in zip((0, 2), (lattice.x_m, lattice.z_m), footprint_m, strict=True):
        share = _share(room, shape[1], origin_m)
        place = origin_m[axis] + share[:, None] * (lines - origin_m[axis])
        spacing = room.size_m[axis] / (shape[axis] - 1)
        v, s = _box_weights(
            (place - room.lower_m[axis]) / spacing, share[:, None] * width_m / (2 * spacing), shape[axis]
        )
        value.append(v)
        slope.append(s / spacing)
    depth_m = room.upper_m[1] - origin_m[1]
    flat = lambda weights, m: (weights * m[:, None, None]).transpose(1, 0, 2).reshape(len(lattice.x_m), -1)  # noqa: E731
    arrays = (
        np.concatenate([flat(slope[0], lever), flat(value[0], edge)]), flat(value[0], lever),
        value[1].transpose(0, 2, 1), slope[1].transpose(0, 2, 1),
        ((lattice.x_m - origin_m[0]) / depth_m)[:, None], ((lattice.z_m - origin_m[2]) / depth_m)[None],
    )  # fmt: skip
    return SeparablePaths(
        *(jnp.asarray(a, jnp.float32) for a in arrays),
        crossing=jnp.asarray(lattice.crossing, jnp.int32),
        weight=jnp.asarray(lattice.weight, jnp.float32),
    )


def _share(room: Box, planes: int, origin_m: np.ndarray) -> Float[np.ndarray, " planes"]:
    """How far along its path each y-plane lies, 0 at the origin and 1 on the wall."""
    y_m = np.linspace(room.lower_m[1], room.upper_m[1], planes)
    return np.clip((y_m - origin_m[1]) / (room.upper_m[1] - origin_m[1]), 0.0, 1.0)


def _box_weights(
    place: Float[np.ndarray, "planes lines"], half: Float[np.ndarray, "planes 1"], nodes: int
) -> tuple[Float[np.ndarray, "planes lines nodes"], Float[np.ndarray, "planes lines nodes"]]:
    """Value and slope of linear interpolation at `place` [cells], averaged over +- half a footprint."""
    place = np.clip(place, 0.0, nodes - 1.0)
    half = np.maximum(half, _SMALLEST_HALF_WIDTH)
    high, low = np.minimum(place + half, nodes - 1.0), np.maximum(place - half, 0.0)
    width = (high - low)[..., None]
    node = np.arange(nodes)
    t_high, t_low = high[..., None] - node, low[..., None] - node
    value = (_hat_integral(t_high) - _hat_integral(t_low)) / width
    return value, (_hat(t_high) - _hat(t_low)) / width


def _hat(t: np.ndarray) -> np.ndarray:
    return np.clip(1 - np.abs(t), 0.0, None)


def _hat_integral(t: np.ndarray) -> np.ndarray:
    t = np.clip(t, -1.0, 1.0)
    return 0.5 + t - np.sign(t) * t**2 / 2


def lattice_through(room: Box, shape: tuple[int, int, int], points_m: Float[np.ndarray, "rays 3"]) -> Lattice:
    """The points' own lines where they form a tensor grid, else a lattice of half a cell over the wall."""
    lines = [np.unique(np.rint(points_m[:, axis] / _SAME_LINE_M), return_inverse=True) for axis in (0, 2)]
    (x, column), (z, row) = lines
    if len(x) * len(z) <= 4 * len(points_m):
        crossing = column * len(z) + row
        return Lattice(x * _SAME_LINE_M, z * _SAME_LINE_M, crossing[:, None], np.ones((len(points_m), 1)))
    taps = []
    for axis in (0, 2):
        count = _LINES_A_CELL * (shape[axis] - 1) + 1
        spacing = room.size_m[axis] / (count - 1)
        taps.append((count, *_catmull_rom((points_m[:, axis] - room.lower_m[axis]) / spacing, count)))
    (columns, i, wx), (rows, k, wz) = taps
    crossing = (i[:, :, None] * rows + k[:, None, :]).reshape(len(points_m), 16)
    weight = (wx[:, :, None] * wz[:, None, :]).reshape(len(points_m), 16)
    x_m, z_m = (np.linspace(room.lower_m[a], room.upper_m[a], c) for a, c in ((0, columns), (2, rows)))
    return Lattice(x_m, z_m, crossing, weight)


def _catmull_rom(
    place: Float[np.ndarray, " rays"], count: int
) -> tuple[Int[np.ndarray, "rays 4"], Float[np.ndarray, "rays 4"]]:
    """Four neighbours and their weights; at an edge the outer neighbour is the edge itself."""
    cell = np.clip(np.floor(place).astype(int), 0, count - 2)
    t = np.clip(place - cell, 0.0, 1.0)
    weights = 0.5 * np.stack(
        [-t + 2 * t**2 - t**3, 2 - 5 * t**2 + 3 * t**3, t + 4 * t**2 - 3 * t**3, -(t**2) + t**3], axis=1
    )
    return np.clip(cell[:, None] + np.arange(-1, 3), 0, count - 1), weights
