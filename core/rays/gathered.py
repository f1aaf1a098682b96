"""Wall shifts from four vertices on every y-plane, for paths that no tensor grid holds.

The general and slower way, for paths that enter through a side of the room. On each plane the path's own
place is used. Cost: 4 vertices a plane; the transpose scatters.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from core.geometry import Box
from core.rays.paths import AbstractWallPaths, Fan, plane_moments


class GatheredPaths(AbstractWallPaths):
    """Lowest vertex of each path on every plane, and the weights of its four corners."""

    vertex: Int[Array, "rays planes"]
    weight_m: Float[Array, "rays planes 2 4"]

    def shift_m(self, excess: Float[Array, "nx ny nz"]) -> Float[Array, "rays 2"]:
        """Wall shift along x and z of each path [m]."""
        _, ny, nz = excess.shape
        flat = excess.reshape(-1)
        corners = jnp.stack(
            [flat.at[self.vertex + s].get(mode="promise_in_bounds") for s in (0, 1, ny * nz, ny * nz + 1)],
            axis=-1,
        )
        return jnp.einsum("rpic,rpc->ri", self.weight_m, corners)

    def chosen(self, rows: Int[Array, " some"]) -> "GatheredPaths":
        """The same map for some of the paths."""
        return GatheredPaths(self.vertex[rows], self.weight_m[rows])


def gathered_paths(room: Box, shape: tuple[int, int, int], fan: Fan) -> GatheredPaths:
    """Vertices and weights of every path of the fan."""
    lower, spacing = np.array(room.lower_m), np.array(room.size_m) / (np.array(shape) - 1)
    entry_y_m = fan.entry_y_m(room)
    lever, edge = plane_moments(room, shape[1], entry_y_m)
    y_m = np.maximum(np.linspace(room.lower_m[1], room.upper_m[1], shape[1]), entry_y_m[:, None])
    cells, fractions = [], []
    for column, axis in enumerate((0, 2)):
        back_m = fan.slopes[:, column, None] * (room.upper_m[1] - y_m)
        place = (fan.points_m[:, axis, None] - back_m - lower[axis]) / spacing[axis]
        cells.append(np.clip(np.floor(place).astype(int), 0, shape[axis] - 2))
        fractions.append(np.clip(place - cells[-1], 0.0, 1.0))
    vertex = (cells[0] * shape[1] + np.arange(shape[1])) * shape[2] + cells[1]
    weight = _weights(fractions, spacing, fan.slopes, lever, edge)
    return GatheredPaths(jnp.asarray(vertex, jnp.int32), jnp.asarray(weight, jnp.float32))


def _weights(
    fractions: list[np.ndarray], spacing: np.ndarray, slopes: np.ndarray, lever: np.ndarray, edge: np.ndarray
) -> Float[np.ndarray, "rays planes 2 4"]:
    """Weights of the corners (x slow, z fast) for shift_x and shift_z."""
    along_x, along_z = (np.stack([1 - f, f], axis=-1) for f in fractions)
    step = np.array([-1.0, 1.0])
    wide = lambda a: a[..., None, None]  # noqa: E731
    value = wide(edge) * along_x[..., :, None] * along_z[..., None, :]
    gx = wide(lever) * step[:, None] / spacing[0] * along_z[..., None, :]
    gz = wide(lever) * along_x[..., :, None] * step / spacing[2]
    p, q = (wide(slopes[:, i, None]) for i in (0, 1))
    across = (1 + p**2) * gx + p * q * gz - p * value
    up = (1 + q**2) * gz + p * q * gx - q * value
    both = (1 + p**2 + q**2)[..., None] * np.stack([across, up], axis=2)
    return both.reshape(*lever.shape, 2, 4)
