"""A field on the vertices of the room, trilinear between them."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from core.fields.cell import blend
from core.fields.field import AbstractField, Components
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

    def at(self, place_m: Components) -> tuple[Float[Array, " points"], Components]:
        """Trilinear value and the gradient of the interpolant."""
        cells = [n - 1 for n in self.values.shape]
        index, fraction = locate(place_m, self.lower_m, self.upper_m, cells)
        value, slopes = blend(jnp.asarray(self.values).astype(fraction[0].dtype), index, fraction)
        dx, dy, dz = self.spacing_m
        return value, (slopes[0] / dx, slopes[1] / dy, slopes[2] / dz)


def locate(
    place_m: Components, lower_m: Vector3, upper_m: Vector3, cells: list[int]
) -> tuple[Int[Array, "points 3"], Components]:
    """Cell of each point and its place in the cell, 0 to 1, held at the outer faces.

    On a face the place has derivative 1, where `clip` would give 1/2.
    """
    index, fraction = [], []
    for p, low, high, count in zip(place_m, lower_m, upper_m, cells, strict=True):
        position = (p - low) * (count / (high - low))
        position = jnp.where(position < 0.0, 0.0, jnp.where(position > count, float(count), position))
        cell = jnp.minimum(position.astype(jnp.int32), count - 1)
        index.append(cell)
        fraction.append(position - cell.astype(position.dtype))
    return jnp.stack(index, axis=-1), (fraction[0], fraction[1], fraction[2])
