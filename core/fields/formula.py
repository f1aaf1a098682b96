"""Fields given by a function of one point: a network, or a formula."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.fields.field import AbstractField, Components, apart


class FunctionField(AbstractField):
    """`function`: point [m] (3,) -> N - N0, a scalar. A network is an `eqx.Module`: its weights learn.

    Value and gradient come from one reverse pass a point. Cost: about three evaluations of the function;
    with a 4 x 128 network some 150 times a trilinear cell.
    """

    function: Callable[[Float[Array, "3"]], Float[Array, ""]]

    def at(self, place_m: Components) -> tuple[Float[Array, " points"], Components]:
        """Value and gradient [1/m]."""
        value, gradient = jax.vmap(jax.value_and_grad(self.function))(jnp.stack(place_m, axis=-1))
        return value, apart(gradient)
