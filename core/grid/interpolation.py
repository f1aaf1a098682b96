"""Linear interpolation on tensor grids as small matrices, one an axis; and at scattered points."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def interpolation_matrix(
    knots: Float[np.ndarray, " knots"], targets: Float[np.ndarray, " targets"]
) -> Float[np.ndarray, "targets knots"]:
    """Rows that interpolate linearly between increasing `knots`, and extrapolate linearly beyond them.

    A single knot is a constant. Exact for linear functions; second order in the spacing.
    """
    if len(knots) == 1:
        return np.ones((len(targets), 1))
    left = np.clip(np.searchsorted(knots, targets, side="right") - 1, 0, len(knots) - 2)
    weight = (targets - knots[left]) / (knots[left + 1] - knots[left])
    matrix = np.zeros((len(targets), len(knots)))
    rows = np.arange(len(targets))
    matrix[rows, left] = 1.0 - weight
    matrix[rows, left + 1] = weight
    return matrix


def on_axes(
    values: Float[Array, "_ _ _"], matrices: Sequence[Float[np.ndarray, "_ _"]]
) -> Float[Array, "_ _ _"]:
    """Interpolate onto a tensor grid: one matrix an axis, from `interpolation_matrix`."""
    for axis, matrix in enumerate(matrices):
        product = jnp.tensordot(jnp.asarray(matrix, values.dtype), values, axes=(1, axis))
        values = jnp.moveaxis(product, 0, axis)
    return values


def at_points(
    values: Float[Array, "_ _ _"],
    knots: Sequence[Float[np.ndarray, " _"]],
    points: Float[Array, "points 3"],
) -> Float[Array, " points"]:
    """Trilinear values at scattered points; equal spacing of the knots is taken for granted."""
    total = jnp.zeros(points.shape[0], values.dtype)
    lefts, weights = [], []
    for axis, knot in enumerate(knots):
        if len(knot) == 1:
            lefts.append(jnp.zeros(points.shape[0], jnp.int32))
            weights.append(jnp.zeros(points.shape[0], points.dtype))
            continue
        position = (points[:, axis] - float(knot[0])) / float(knot[1] - knot[0])
        left = jnp.clip(jnp.floor(position), 0, len(knot) - 2).astype(jnp.int32)
        lefts.append(left)
        weights.append(position - left.astype(points.dtype))
    for corner in np.ndindex(2, 2, 2):
        weight = jnp.ones_like(total)
        index = []
        for axis, side in enumerate(corner):
            weight = weight * (weights[axis] if side else 1.0 - weights[axis])
            index.append(jnp.minimum(lefts[axis] + side, values.shape[axis] - 1))
        total = total + weight * values[index[0], index[1], index[2]]
    return total
