"""Sums along rays whose gradient stores nothing: the memory does not grow with the number of steps."""

from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

Term = TypeVar("Term", bound=PyTree)


def sum_along(term: Callable[[PyTree, Array], Term], inputs: PyTree, steps: int) -> Term:
    """sum_i term(inputs, i) for i = 0 ... steps - 1, i as a scalar array of the inputs' float type.

    `term` closes over nothing that is differentiated. Its cotangent is the same for every i, so the
    backward pass evaluates each term anew and keeps none: cost, one forward and one backward of `term`
    a step; memory, one step.
    """
    return _sum(inputs, term, steps)


@eqx.filter_custom_vjp
def _sum(inputs: PyTree, term: Callable, steps: int) -> PyTree:
    places = _places(inputs, steps)
    add = lambda total, i: (jax.tree.map(jnp.add, total, term(inputs, i)), None)  # noqa: E731
    return jax.lax.scan(add, _zeros(inputs, term, places), places)[0]


@_sum.def_fwd
def _sum_forward(perturbed: PyTree, inputs: PyTree, term: Callable, steps: int) -> tuple[PyTree, None]:
    return _sum(inputs, term, steps), None


@_sum.def_bwd
def _sum_backward(
    _: None, cotangent: PyTree, perturbed: PyTree, inputs: PyTree, term: Callable, steps: int
) -> PyTree:
    moving, still = perturbed_part(perturbed, inputs)
    places = _places(inputs, steps)
    # An output that the loss does not use has no cotangent.
    bars = eqx.combine(cotangent, _zeros(inputs, term, places))

    def add(total: PyTree, i: Array) -> tuple[PyTree, None]:
        _, pull_back = jax.vjp(lambda m: term(eqx.combine(m, still), i), moving)
        return jax.tree.map(jnp.add, total, pull_back(bars)[0]), None

    return jax.lax.scan(add, jax.tree.map(jnp.zeros_like, moving), places)[0]


def perturbed_part(perturbed: PyTree, inputs: PyTree) -> tuple[PyTree, PyTree]:
    """What is differentiated, and the rest: nothing is spent on gradients that nobody asked for."""
    asked = jax.tree.map(lambda leaf, p: eqx.is_inexact_array(leaf) and bool(p), inputs, perturbed)
    return eqx.partition(inputs, asked)


def _places(inputs: PyTree, steps: int) -> Array:
    leaves = jax.tree.leaves(eqx.filter(inputs, eqx.is_inexact_array))
    return jnp.arange(steps).astype(jnp.result_type(*leaves))


def _zeros(inputs: PyTree, term: Callable, places: Array) -> PyTree:
    shapes = eqx.filter_eval_shape(term, inputs, places[0])
    return jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes)
