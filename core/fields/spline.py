"""A field on the vertices of the room, a cubic B-spline between them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from scipy.linalg import solve_banded

from core.fields.field import AbstractField, Components
from core.fields.vertex_field import locate
from core.geometry import Vector3


class SplineField(AbstractField):
    """Uniform cubic B-spline: value, gradient and second derivatives are continuous.

    `coefficients` reach one spacing past the box on every side; `through_vertices` finds those that pass
    through given values. Cost: 64 coefficients a point, about eight times the trilinear field. Error against
    a smooth field: fourth order in the spacing for the value, third for the gradient. It may overshoot at a
    jump, where `GridField` does not.
    """

    lower_m: Vector3 = eqx.field(static=True)
    upper_m: Vector3 = eqx.field(static=True)
    coefficients: Float[Array, "nx_2 ny_2 nz_2"] | Float[np.ndarray, "nx_2 ny_2 nz_2"]

    def at(self, place_m: Components) -> tuple[Float[Array, " points"], Components]:
        """Value and gradient [1/m]; outside the box the nearest face's."""
        cells = [n - 3 for n in self.coefficients.shape]
        index, fraction = locate(place_m, self.lower_m, self.upper_m, cells)
        block = _blocks(jnp.asarray(self.coefficients).astype(fraction[0].dtype), index, 4)
        (wx, wy, wz), (sx, sy, sz) = (tuple(f(t) for t in fraction) for f in (_weights, _slopes))
        value_z = jnp.einsum("pijk,pk->pij", block, wz)
        slope_z = jnp.einsum("pijk,pk->pij", block, sz)
        value_yz = jnp.einsum("pij,pj->pi", value_z, wy)
        per_m = [n / (u - low) for n, low, u in zip(cells, self.lower_m, self.upper_m, strict=True)]
        gradient = (
            jnp.einsum("pi,pi->p", value_yz, sx) * per_m[0],
            jnp.einsum("pij,pi,pj->p", value_z, wx, sy) * per_m[1],
            jnp.einsum("pij,pi,pj->p", slope_z, wx, wy) * per_m[2],
        )
        return jnp.einsum("pi,pi->p", value_yz, wx), gradient


def through_vertices(
    lower_m: Vector3, upper_m: Vector3, values: Float[np.ndarray, "nx ny nz"]
) -> SplineField:
    """The spline through vertex values, its second derivative zero across the faces. Solved in float64."""
    coefficients = np.asarray(values, np.float64)
    for axis in range(3):
        coefficients = np.moveaxis(_solve(np.moveaxis(coefficients, axis, 0)), 0, axis)
    return SplineField(lower_m, upper_m, coefficients.astype(values.dtype))


def _solve(values: np.ndarray) -> np.ndarray:
    """Coefficients along the first axis: (c[i-1] + 4 c[i] + c[i+1]) / 6 = v[i]; the ends are v themselves."""
    count = len(values)
    bands = np.zeros((3, count))
    bands[0, 2:], bands[1], bands[2, :-2] = 1 / 6, 4 / 6, 1 / 6
    bands[1, 0] = bands[1, -1] = 1.0
    inner = solve_banded((1, 1), bands, values.reshape(count, -1)).reshape(values.shape)
    return np.concatenate([2 * inner[:1] - inner[1:2], inner, 2 * inner[-1:] - inner[-2:-1]])


def _blocks(
    coefficients: Float[Array, "nx_2 ny_2 nz_2"], first: Int[Array, "points 3"], size: int
) -> Float[Array, "points size size size"]:
    """The block of `size`^3 coefficients that starts at each index: one gather, transposed one scatter."""
    numbers = jax.lax.GatherDimensionNumbers((1, 2, 3), (), (0, 1, 2))
    return jax.lax.gather(coefficients, first, numbers, (size, size, size), mode="promise_in_bounds")


def _weights(t: Float[Array, " points"]) -> Float[Array, "points 4"]:
    r = 1.0 - t
    inner = lambda s: (4.0 - 3.0 * s * s * (2.0 - s)) / 6.0  # noqa: E731
    return jnp.stack([r**3 / 6.0, inner(t), inner(r), t**3 / 6.0], axis=-1)


def _slopes(t: Float[Array, " points"]) -> Float[Array, "points 4"]:
    r = 1.0 - t
    inner = lambda s: 0.5 * s * (3.0 * s - 4.0)  # noqa: E731
    return jnp.stack([-0.5 * r * r, inner(t), -inner(r), 0.5 * t * t], axis=-1)
