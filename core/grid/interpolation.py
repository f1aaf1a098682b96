"""Linear interpolation on tensor grids as small matrices, one an axis; and at scattered points."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

_BATCHED_UP_TO = 40


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
    return _contracted(values[None], [matrix[None] for matrix in matrices])[0]


def on_axes_together(
    components: Sequence[Float[Array, "_ _ _"]], matrices: Sequence[Sequence[Float[np.ndarray, "_ _"]]]
) -> list[Float[Array, "_ _ _"]]:
    """Interpolate several arrays, each with its own three matrices.

    Small ones as three batched products, filled up with zeros to one shape: half the time to compile, and
    as fast up to some 32^3 targets. Twice as slow at 64^3, which are done one by one.
    """
    if max(matrix.shape[0] for own in matrices for matrix in own) > _BATCHED_UP_TO:
        return [on_axes(c, own) for c, own in zip(components, matrices, strict=True)]
    knots = [max(c.shape[axis] for c in components) for axis in range(3)]
    targets = [max(m[axis].shape[0] for m in matrices) for axis in range(3)]
    stacked = jnp.stack(
        [jnp.pad(c, [(0, n - size) for n, size in zip(knots, c.shape, strict=True)]) for c in components]
    )
    padded = []
    for axis in range(3):
        together = np.zeros((len(components), targets[axis], knots[axis]))
        for place, own in enumerate(matrices):
            rows, columns = own[axis].shape
            together[place, :rows, :columns] = own[axis]
        padded.append(together)
    found = _contracted(stacked, padded)
    shapes = [tuple(matrix.shape[0] for matrix in own) for own in matrices]
    return [found[place, :nx, :ny, :nz] for place, (nx, ny, nz) in enumerate(shapes)]


def _contracted(
    values: Float[Array, "fields _ _ _"], matrices: Sequence[Float[np.ndarray, "fields _ _"]]
) -> Float[Array, "fields _ _ _"]:
    """One axis after the other, that which shrinks most first; each product puts its axis last."""
    held = [0, 1, 2]
    for axis in sorted(held, key=lambda a: matrices[a].shape[1] / matrices[a].shape[2]):
        matrix = jnp.asarray(matrices[axis], values.dtype)
        values = jax.lax.dot_general(values, matrix, (((1 + held.index(axis),), (2,)), ((0,), (0,))))
        held = [a for a in held if a != axis] + [axis]
    return jnp.transpose(values, (0, *(1 + held.index(axis) for axis in range(3))))


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
