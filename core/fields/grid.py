"""A field on the vertices of the room, trilinear between them."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from core.fields.field import AbstractField
from core.geometry import Vector3
from core.setting import SettingError


class GridField(AbstractField):
    """Trilinear interpolation of vertex values; the gradient is the interpolant's own.

    Along its own axis the gradient is constant in a cell and jumps at the cell's faces; along the two
    others it is bilinear. It is *not* an interpolation of gradients taken at the vertices: value and
    gradient belong to one function, so a ray keeps |v| = eta and the transposed operator is exact.
    Outside the box the nearest face's value holds and the gradient of the nearest cell.

    `values`: N - N0 on vertices, end planes included, index order [ix, iy, iz]; float32 or float64.
    Cost: 8 values a point. Error against a smooth field: second order in the spacing for the value,
    first order for the gradient at a point (second order on average over a cell).
    """

    lower_m: Vector3 = eqx.field(static=True)
    upper_m: Vector3 = eqx.field(static=True)
    values: Float[Array, "nx ny nz"] | Float[np.ndarray, "nx ny nz"]

    def __check_init__(self) -> None:
        if min(self.values.shape) < 2:
            raise SettingError(
                f"A grid field has {self.values.shape} vertices; expected at least 2 on every axis. "
                "Give values on vertices, end planes included."
            )

    @property
    def spacing_m(self) -> Vector3:
        """Distance between vertices along x, y, z."""
        dx, dy, dz = (
            (u - low) / (n - 1)
            for low, u, n in zip(self.lower_m, self.upper_m, self.values.shape, strict=True)
        )
        return dx, dy, dz

    def excess(self, points_m: Float[Array, "points 3"]) -> Float[Array, " points"]:
        """Trilinear value at each point."""
        corners, fraction = self._cells(points_m)
        for axis in (2, 1, 0):
            corners = _blend(corners, fraction[:, axis])
        return corners[0]

    def excess_and_gradient(
        self, points_m: Float[Array, "points 3"]
    ) -> tuple[Float[Array, " points"], Float[Array, "points 3"]]:
        """Trilinear value and the gradient of the interpolant."""
        corners, fraction = self._cells(points_m)
        fx, fy, fz = fraction[:, 0], fraction[:, 1], fraction[:, 2]
        dx, dy, dz = self.spacing_m
        flat_z = _blend(corners, fz)
        flat_yz = _blend(flat_z, fy)
        slope_z = [high - low for low, high in zip(corners[::2], corners[1::2], strict=True)]
        slope_y = [flat_z[1] - flat_z[0], flat_z[3] - flat_z[2]]
        gradient = jnp.stack(
            [
                (flat_yz[1] - flat_yz[0]) / dx,
                _blend(slope_y, fx)[0] / dy,
                _blend(_blend(slope_z, fy), fx)[0] / dz,
            ],
            axis=-1,
        )
        return _blend(flat_yz, fx)[0], gradient

    def _cells(
        self, points_m: Float[Array, "points 3"]
    ) -> tuple[list[Float[Array, " points"]], Float[Array, "points 3"]]:
        """The eight corner values in the order 000, 001, 010, ... (x slowest) and the place in the cell."""
        dtype = points_m.dtype
        shape = self.values.shape
        last = jnp.asarray([n - 2 for n in shape], jnp.int32)
        lower = jnp.asarray(self.lower_m, dtype)
        scale = jnp.asarray([1.0 / d for d in self.spacing_m], dtype)
        position = (points_m - lower[None]) * scale[None]
        cell = jnp.clip(jnp.floor(position).astype(jnp.int32), 0, last[None])
        fraction = jnp.clip(position - cell.astype(dtype), 0.0, 1.0)
        base = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
        flat = jnp.asarray(self.values).reshape(-1)
        strides = [(i * shape[1] + j) * shape[2] + k for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        return [_take(flat, base + stride) for stride in strides], fraction


def _take(flat: Float[Array, " vertices"], index: Int[Array, " points"]) -> Float[Array, " points"]:
    return flat.at[index].get(mode="promise_in_bounds")


def _blend(
    values: list[Float[Array, " points"]], fraction: Float[Array, " points"]
) -> list[Float[Array, " points"]]:
    """Interpolate neighbours in pairs: half as many values."""
    return [low + fraction * (high - low) for low, high in zip(values[::2], values[1::2], strict=True)]
