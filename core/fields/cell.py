"""Trilinear value and slopes in the cells of a grid, and a transpose that costs little more than they do.

A compiler fuses a scatter with what feeds it and works every corner's share out anew for each number that
it writes. So the shares are written as one product over the eight corners, which costs nothing to repeat.
"""

from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from core.fields.field import Components

Answer = tuple[Float[Array, " points"], Components]
# Corners of a cell, x slowest, z fastest: 0 low, 1 high.
_CORNERS = np.array(list(product((0, 1), repeat=3)))
_PAIR = jax.lax.GatherDimensionNumbers((1,), (), (0,))
_PAIR_BACK = jax.lax.ScatterDimensionNumbers((1,), (), (0,))


@jax.custom_vjp
def blend(values: Float[Array, "nx ny nz"], index: Int[Array, "points 3"], fraction: Components) -> Answer:
    """Value and slopes per cell at `fraction` (0 to 1) of the cells `index`."""
    return _interpolate(_corners(values, index), fraction)


def _blend_forward(
    values: Array, index: Array, fraction: Components
) -> tuple[Answer, tuple[Array, Array, Components]]:
    return blend(values, index, fraction), (values, index, fraction)


def _blend_backward(
    kept: tuple[Array, Array, Components], bars: Answer
) -> tuple[Float[Array, "nx ny nz"], None, Components]:
    values, index, fraction = kept
    corners = _corners(values, index)
    _, pull_back = jax.vjp(lambda f: _interpolate(corners, f), fraction)
    shares, total = _shares(fraction, bars), jnp.zeros(values.size, values.dtype)
    for pair, first in enumerate(_pairs(values.shape, index)):
        two = shares[:, 2 * pair : 2 * pair + 2]
        total = jax.lax.scatter_add(total, first, two, _PAIR_BACK, mode="promise_in_bounds")
    return total.reshape(values.shape), None, pull_back(bars)[0]


blend.defvjp(_blend_forward, _blend_backward)


def _pairs(shape: tuple[int, ...], index: Int[Array, "points 3"]) -> list[Int[Array, "points 1"]]:
    """Place of the lower vertex of each of a cell's four z-edges, in the flattened values."""
    _, ny, nz = shape
    lowest = ((index[:, 0] * ny + index[:, 1]) * nz + index[:, 2])[:, None]
    return [lowest + step for step in (0, nz, ny * nz, (ny + 1) * nz)]


def _corners(
    values: Float[Array, "nx ny nz"], index: Int[Array, "points 3"]
) -> tuple[Float[Array, " points"], ...]:
    """The eight corners of each cell."""
    flat = values.reshape(-1)
    pairs = [
        jax.lax.gather(flat, p, _PAIR, (2,), mode="promise_in_bounds") for p in _pairs(values.shape, index)
    ]
    return tuple(pair[:, end] for pair in pairs for end in (0, 1))


def _interpolate(corners: tuple[Float[Array, " points"], ...], fraction: Components) -> Answer:
    """Value and slopes per cell, blending z, then y, then x."""
    fx, fy, fz = fraction
    pairs = list(zip(corners[::2], corners[1::2], strict=True))
    slope_z = [high - low for low, high in pairs]
    on_z = [low + fz * step for (low, _), step in zip(pairs, slope_z, strict=True)]
    slope_y = [on_z[1] - on_z[0], on_z[3] - on_z[2]]
    on_y = [on_z[0] + fy * slope_y[0], on_z[2] + fy * slope_y[1]]
    z_on_y = [a + fy * (b - a) for a, b in (slope_z[:2], slope_z[2:])]
    slope_x = on_y[1] - on_y[0]
    y, z = (low + fx * (high - low) for low, high in (slope_y, z_on_y))
    return on_y[0] + fx * slope_x, (slope_x, y, z)


def _shares(fraction: Components, bars: Answer) -> Float[Array, "points 8"]:
    """What each corner receives: `_interpolate` transposed, as a product of one factor an axis."""
    high = jnp.asarray(_CORNERS, fraction[0].dtype)
    sign = 2.0 * high - 1.0
    x, y, z = (1.0 - high[:, a][None] + sign[:, a][None] * f[:, None] for a, f in enumerate(fraction))
    sx, sy, sz = (sign[:, a][None] for a in range(3))
    value, (gx, gy, gz) = bars[0][:, None], (b[:, None] for b in bars[1])
    return x * (y * (value * z + gz * sz) + gy * sy * z) + gx * sx * y * z
