"""What a ray asks of the air: the excess refractivity and its gradient.

    n(x) = N(x) - N0        [-]         grad n        [1/m]

Only the excess over the air at rest is carried: 1 K moves the index by 9.3e-7, eight float32 steps near
1.0, but it moves the excess by 9.3e-7 of itself, which float32 holds to seven digits.
"""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

# Components apart: arrays of three-vectors cost a compiler's fusion, and rays three times as long.
Components = tuple[Float[Array, " points"], Float[Array, " points"], Float[Array, " points"]]


class AbstractField(eqx.Module):
    """Excess refractivity in the room, asked for at a batch of points.

    The two answers of one field agree: the gradient is the exact gradient of the value wherever that has
    one. Points are world coordinates [m].
    """

    @abstractmethod
    def at(self, place_m: Components) -> tuple[Float[Array, " points"], Components]:
        """N - N0 and the components of its gradient [1/m], from the coordinates' components."""

    def excess(self, points_m: Float[Array, "points 3"]) -> Float[Array, " points"]:
        """n = N - N0 at each point."""
        return self.at(apart(points_m))[0]

    def excess_and_gradient(
        self, points_m: Float[Array, "points 3"]
    ) -> tuple[Float[Array, " points"], Float[Array, "points 3"]]:
        """N - N0 and its gradient [1/m] at each point."""
        value, slopes = self.at(apart(points_m))
        return value, jnp.stack(slopes, axis=-1)


def apart(vectors: Float[Array, "points 3"]) -> Components:
    """The three components of a batch of vectors."""
    return vectors[:, 0], vectors[:, 1], vectors[:, 2]
