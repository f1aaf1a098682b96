"""A field on the vertices of the room, trilinear between them."""

import equinox as eqx
import jax
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
        return _interpolate(*self._cells(points_m))[0]

    def excess_and_gradient(
        self, points_m: Float[Array, "points 3"]
    ) -> tuple[Float[Array, " points"], Float[Array, "points 3"]]:
        """Trilinear value and the gradient of the interpolant."""
        value, slopes = _interpolate(*self._cells(points_m))
        per_m = jnp.asarray([1.0 / d for d in self.spacing_m], points_m.dtype)
        return value, slopes * per_m[None]

    def _cells(
        self, points_m: Float[Array, "points 3"]
    ) -> tuple[Float[Array, "points 2 2 2"], Float[Array, "points 3"]]:
        """The corners of each point's cell and its place in the cell, 0 to 1."""
        dtype = points_m.dtype
        last = jnp.asarray([n - 2 for n in self.values.shape], jnp.int32)
        lower = jnp.asarray(self.lower_m, dtype)
        per_m = jnp.asarray([1.0 / d for d in self.spacing_m], dtype)
        position = hold((points_m - lower[None]) * per_m[None], last + 1)
        cell = jnp.clip(position.astype(jnp.int32), 0, last[None])
        return gather_blocks(jnp.asarray(self.values).astype(dtype), cell, 2), position - cell.astype(dtype)


def hold(position: Float[Array, "points 3"], last: Int[Array, "3"]) -> Float[Array, "points 3"]:
    """The position, held at the outer faces; on a face its derivative is 1, where `clip` would give 1/2."""
    end = last.astype(position.dtype)[None]
    return jnp.where(position < 0.0, 0.0, jnp.where(position > end, end, position))


def gather_blocks(
    values: Float[Array, "nx ny nz"], first: Int[Array, "points 3"], size: int
) -> Float[Array, "points size size size"]:
    """The block of `size`^3 vertices that starts at each index: one gather, transposed one scatter."""
    numbers = jax.lax.GatherDimensionNumbers((1, 2, 3), (), (0, 1, 2))
    return jax.lax.gather(values, first, numbers, (size, size, size), mode="promise_in_bounds")


def _interpolate(
    corners: Float[Array, "points 2 2 2"], fraction: Float[Array, "points 3"]
) -> tuple[Float[Array, " points"], Float[Array, "points 3"]]:
    """Value and slopes per cell, blending the axes from the last to the first."""
    fx, fy, fz = fraction[:, 0], fraction[:, 1], fraction[:, 2]
    step_z = corners[..., 1] - corners[..., 0]
    on_z = corners[..., 0] + fz[:, None, None] * step_z
    step_y = on_z[..., 1] - on_z[..., 0]
    on_yz = on_z[..., 0] + fy[:, None] * step_y
    slope_z = step_z[..., 0] + fy[:, None] * (step_z[..., 1] - step_z[..., 0])
    slope_x = on_yz[:, 1] - on_yz[:, 0]
    slopes = [slope_x, *(s[:, 0] + fx * (s[:, 1] - s[:, 0]) for s in (step_y, slope_z))]
    return on_yz[:, 0] + fx * slope_x, jnp.stack(slopes, axis=-1)
