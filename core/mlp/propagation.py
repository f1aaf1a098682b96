"""Value, Jacobian and Laplacian through one layer, as batched products instead of nested derivatives.

With z = W a + b and a' = s(z), along positions x:

    J z = W J a            ∇²z = W ∇²a
    J a' = s'(z) J z       ∇²a' = s'(z) ∇²z + s''(z) |J z|²

The five arrays (value, three derivatives, Laplacian) go through each layer as one matrix product.
Exact to rounding; needs s, s', s'' in closed form.
"""

from collections.abc import Callable
from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

Activation = Literal["tanh", "swish", "sine"]
Values = Float[Array, "..."]


def activate(name: Activation, z: Values) -> Values:
    """s(z)."""
    return _VALUE[name](z)


def propagate_linear(
    stack: Float[Array, "5 points inputs"],
    weight: Float[Array, "inputs outputs"],
    bias: Float[Array, " outputs"],
) -> Float[Array, "5 points outputs"]:
    """Through W and b: rows of `stack` are value, d/dx, d/dy, d/dz, Laplacian; b moves the value only."""
    return (stack @ weight).at[0].add(bias[None, :])


def propagate_activation(
    name: Activation, stack: Float[Array, "5 points outputs"]
) -> Float[Array, "5 points outputs"]:
    """Through s, by the chain rule above."""
    value, first, second = _DERIVATIVES[name](stack[0])
    gradient = stack[1:4]
    bend = second * (gradient * gradient).sum(0)
    return jnp.concatenate([value[None], first[None] * gradient, (first * stack[4] + bend)[None]])


def _tanh(z: Values) -> tuple[Values, Values, Values]:
    value = jnp.tanh(z)
    first = 1.0 - value * value
    return value, first, -2.0 * value * first


def _swish(z: Values) -> tuple[Values, Values, Values]:
    gate = jax.nn.sigmoid(z)
    slope = gate * (1.0 - gate)
    return z * gate, gate + z * slope, slope * (2.0 + z * (1.0 - 2.0 * gate))


def _sine(z: Values) -> tuple[Values, Values, Values]:
    value = jnp.sin(z)
    return value, jnp.cos(z), -value


_VALUE: dict[str, Callable[[Values], Values]] = {
    "tanh": jnp.tanh,
    "swish": jax.nn.swish,
    "sine": jnp.sin,
}
_DERIVATIVES: dict[str, Callable[[Values], tuple[Values, Values, Values]]] = {
    "tanh": _tanh,
    "swish": _swish,
    "sine": _sine,
}
