"""What a ray asks of the air: the excess refractivity and its gradient.

    n(x) = N(x) - N0        [-]         grad n        [1/m]

Only the excess over the air at rest is carried: 1 K moves the index by 9.3e-7, eight float32 steps near
1.0, but it moves the excess by 9.3e-7 of itself, which float32 holds to seven digits.
"""

from abc import abstractmethod

import equinox as eqx
from jaxtyping import Array, Float


class AbstractField(eqx.Module):
    """Excess refractivity in the room, asked for at a batch of points.

    The two answers of one field agree: `gradient` is the exact gradient of `excess` wherever that has
    one. Points are world coordinates [m].
    """

    @abstractmethod
    def excess(self, points_m: Float[Array, "points 3"]) -> Float[Array, " points"]:
        """n = N - N0 at each point."""

    @abstractmethod
    def excess_and_gradient(
        self, points_m: Float[Array, "points 3"]
    ) -> tuple[Float[Array, " points"], Float[Array, "points 3"]]:
        """N - N0 and its gradient [1/m] at each point."""
