"""Nonlinear least squares: Gauss-Newton steps by preconditioned conjugate gradients, with damping.

    minimise ½ |r(z)|²        (S JᵀJ S + μ) y = −S Jᵀ r        z ← z + S y

J is never formed: products by linearising r. S scales each leaf of z by its mean column norm, measured
with random signs, so that unknowns of unlike size or level count alike (Jacobi's scaling, leaf by leaf).
The damping μ follows Levenberg and Marquardt. Cost: two linearised residuals a CG iteration.

Conjugate gradients run in short bursts, so that a caller can stop within one; r is linearised once a burst.
"""

import time
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

ResidualFunction = Callable[[Any, Any], PyTree]

_BURST_S = 0.5
# Half the compile time of the default level; the same run time, measured on the room at 32^3.
_compiled = eqx.filter_jit(compiler_options={"xla_backend_optimization_level": 1})  # pyright: ignore


class NewtonStep(eqx.Module):
    """One Gauss-Newton step: the new unknowns, half the squared residual before and after, CG's work."""

    unknowns: PyTree
    cost_before: Float[Array, ""]
    cost_after: Float[Array, ""]
    cg_iterations: Int[Array, ""]


class _Search(eqx.Module):
    """Conjugate gradients between two iterations; `used` is -1 before the gradient is known."""

    y: PyTree
    remainder: PyTree
    direction: PyTree
    square: Float[Array, ""]
    first_square: Float[Array, ""]
    used: Int[Array, ""]


def gauss_newton_step(
    residual: ResidualFunction,
    unknowns: PyTree,
    data: PyTree,
    damping: Float[Array, ""],
    cg_iterations: int,
    cg_tolerance: float,
    *,
    scale: PyTree | None = None,
    should_stop: Callable[[], bool] = lambda: False,
) -> NewtonStep | None:
    """Linearise `residual(unknowns, data)`, solve for a step, and say what it would cost.

    Whether to take it is the caller's: `cost_after` may be above `cost_before`. None where `should_stop`
    said so first, within about a second. `scale` is `column_scale` of these or earlier unknowns.
    """
    scale = column_scale(residual, unknowns, data) if scale is None else scale
    zero = jax.tree.map(jnp.zeros_like, unknowns)
    one = jnp.ones((), jnp.result_type(*jax.tree.leaves(unknowns)))
    search, burst = _Search(zero, zero, zero, one, one, jnp.int32(-1)), 2
    while not should_stop():
        began, before = time.perf_counter(), int(search.used)
        until = jnp.int32(min(before + burst, cg_iterations))
        search = _advance(residual, unknowns, data, scale, damping, search, until, one * cg_tolerance)
        if int(search.used) >= cg_iterations or int(search.used) < int(until):
            moved = jax.tree.map(lambda z, s, y: z + s * y, unknowns, scale, search.y)
            before_cost = half_square(residual, unknowns, data)
            return NewtonStep(moved, before_cost, half_square(residual, moved, data), search.used)
        if before > 0:  # the first burst compiles
            burst = max(1, min(20, int(burst * _BURST_S / (time.perf_counter() - began))))
    return None


def column_scale(residual: ResidualFunction, unknowns: PyTree, data: PyTree) -> PyTree:
    """One over the root mean square column norm of J, leaf by leaf; 1 where a leaf moves nothing."""
    # Drawn by NumPy: fifteen of JAX's generators, one a shape, take longer to compile than all the rest.
    generator = np.random.default_rng(0)
    signs = jax.tree.map(lambda a: (2 * generator.integers(0, 2, a.shape) - 1).astype(a.dtype), unknowns)
    return _column_scale(residual, unknowns, data, signs)


@_compiled
def _column_scale(residual: ResidualFunction, unknowns: PyTree, data: PyTree, signs: PyTree) -> PyTree:
    _, product = jax.linearize(lambda z: residual(z, data), unknowns)
    leaves, tree = jax.tree.flatten(signs)

    def square(chosen: Float[Array, " leaves"]) -> Float[Array, ""]:
        probe = [sign * on for sign, on in zip(leaves, chosen, strict=True)]
        rows = product(jax.tree.unflatten(tree, probe))
        return _dot(rows, rows)

    # A loop, not fifteen copies of the linearised residuals in one program.
    norms = jax.lax.map(square, jnp.eye(len(leaves), dtype=leaves[0].dtype))
    norms = norms / jnp.array([max(leaf.size, 1) for leaf in leaves], norms.dtype)
    scales = jnp.where(norms > 0, jax.lax.rsqrt(jnp.maximum(norms, 1e-30)), 1.0)
    return jax.tree.unflatten(tree, list(scales))


@_compiled
def half_square(residual: ResidualFunction, unknowns: PyTree, data: PyTree) -> Float[Array, ""]:
    """Half the squared residual."""
    rows = residual(unknowns, data)
    return 0.5 * _dot(rows, rows)


@_compiled
def _advance(
    residual: ResidualFunction,
    unknowns: PyTree,
    data: PyTree,
    scale: PyTree,
    damping: Float[Array, ""],
    search: _Search,
    until: Int[Array, ""],
    tolerance: Float[Array, ""],
) -> _Search:
    """CG until `until` iterations are used, or fewer where it has converged.

    The gradient is the first turn of the same loop: J and its transpose are compiled once.
    """
    value, product = jax.linearize(lambda z: residual(z, data), unknowns)
    transpose = jax.linear_transpose(product, unknowns)

    def unfinished(s: _Search) -> Array:
        return (s.used < until) & ((s.square > tolerance**2 * s.first_square) | (s.used < 0))

    def advance(s: _Search) -> _Search:
        begins = s.used < 0
        rows = product(jax.tree.map(jnp.multiply, scale, s.direction))
        rows = jax.tree.map(lambda v, w: jnp.where(begins, -v, w), value, rows)
        q = jax.tree.map(lambda c, b, d: c * b + damping * d, scale, transpose(rows)[0], s.direction)
        alpha = jnp.where(begins, -1.0, s.square / _dot(s.direction, q))
        y = jax.tree.map(lambda a, b: a + alpha * b, s.y, s.direction)
        remainder = jax.tree.map(lambda a, b: a - alpha * b, s.remainder, q)
        square = _dot(remainder, remainder)
        beta = jnp.where(begins, 0.0, square / s.square)
        direction = jax.tree.map(lambda a, b: a + beta * b, remainder, s.direction)
        first = jnp.where(begins, square, s.first_square)
        return _Search(y, remainder, direction, square, first, s.used + 1)

    return jax.lax.while_loop(unfinished, advance, search)


def _dot(a: PyTree, b: PyTree) -> Float[Array, ""]:
    return jnp.stack(jax.tree.leaves(jax.tree.map(jnp.vdot, a, b))).sum()
