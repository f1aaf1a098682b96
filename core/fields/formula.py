"""Fields given by a function of one point: a network, or a formula."""

from collections.abc import Callable

import jax
from jaxtyping import Array, Float

from core.fields.field import AbstractField


class FunctionField(AbstractField):
    """`function`: point [m] (3,) -> N - N0, a scalar. A network is an `eqx.Module`: its weights learn.

    Value and gradient come from one reverse pass a point. Cost: about three evaluations of the function;
    with a 4 x 128 network some 150 times a trilinear cell.
    """

    function: Callable[[Float[Array, "3"]], Float[Array, ""]]

    def excess(self, points_m: Float[Array, "points 3"]) -> Float[Array, " points"]:
        """Value at each point."""
        return jax.vmap(self.function)(points_m)

    def excess_and_gradient(
        self, points_m: Float[Array, "points 3"]
    ) -> tuple[Float[Array, " points"], Float[Array, "points 3"]]:
        """Value and gradient [1/m] at each point."""
        return jax.vmap(jax.value_and_grad(self.function))(points_m)
