"""How long a step may be, and how much longer where the air is slow.

On the way to a steady state time need not be true, and two things shorten it. Neither moves that state:

- Each cell takes the step that is stable there, up to `_LONGER` times the shortest one, and no longer than any of its
  neighbours could: slow air far from the jets catches up.
- Internal waves, which would go to and fro for minutes, are damped: where warm air lies over cold, buoyancy is that
  of the air as it would be `_AHEAD` steps later. What the air will gain is nothing at the end.
"""

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from core.room.room_grid import AXES, Cells, RoomGrid, cut, difference, face_mean

# On room A, 32 cells an edge, 3 to 6 and 8 to 32 come to the steady state as soon, 2 takes a third more steps.
_LONGER, _AHEAD = 4.0, 16.0
# The share of a wave's velocity that a step takes at most; above 2 the wave would grow.
_STABLE = 0.5


class StepLimits(eqx.Module):
    """Limits of a step.

    The Courant number, summed over the axes; how much longer a slow cell's step may be than the shortest; for how
    many steps ahead buoyancy is taken; the longest mean step [s].
    """

    courant: Float[Array, ""]
    longer: Float[Array, ""]
    ahead: Float[Array, ""]
    longest_s: Float[Array, ""]


def step_limits(courant: float, longest_s: float, *, steady: bool, first: bool = False) -> StepLimits:
    """`steady`: time need not be true. The `first` steps are alike everywhere: air at rest does not stay so."""
    longer = _LONGER if steady and not first else 1.0
    values = (courant, longer, _AHEAD if steady else 0.0, longest_s)
    return StepLimits(*(jnp.float32(value) for value in values))


class Pace(eqx.Module):
    """The shortest step [s], each cell's own step over it, and for how many steps ahead buoyancy is taken."""

    shortest_s: Float[Array, ""]
    longer: Cells
    ahead: Float[Array, ""]

    @property
    def own_s(self) -> Cells:
        """Each cell's step."""
        return self.shortest_s * self.longer

    def faces_s(self, axis: int) -> Float[Array, "..."]:
        """The step of the inner faces: the shorter one of the two cells beside."""
        return self.shortest_s * jnp.minimum(cut(self.longer, 0, -1, axis), cut(self.longer, 1, 0, axis))


def pace_of(rate_per_s: Cells, limits: StepLimits) -> Pace:
    """The steps whose product with `rate_per_s` is at most 1 in every cell."""
    fastest = jnp.max(rate_per_s)
    longer = jnp.minimum(fastest / rate_per_s, limits.longer)
    for a in AXES:
        edge = [(1, 1) if a == b else (0, 0) for b in AXES]
        padded = jnp.pad(longer, edge, mode="edge")
        longer = jnp.minimum(jnp.minimum(cut(padded, 0, -2, a), longer), cut(padded, 2, 0, a))
    longer = lax.optimization_barrier(longer)
    return Pace(jnp.minimum(1.0 / fastest, limits.longest_s / jnp.mean(longer)), longer, limits.ahead)


def wave_damping_k(
    excess_k: Cells, heating_k_s: Cells, buoyancy_m_s2_k: Float[Array, ""], pace: Pace, grid: RoomGrid
) -> Float[Array, "nx ny inner"]:
    """How much warmer the air between two layers will be some steps later; 0 where cold air lies over warm.

    With this added to T a wave of the frequency N loses N^2 tau dt of its velocity in a step; tau is how far ahead.
    """
    own_s = pace.faces_s(2)
    steeper = jnp.maximum(difference(excess_k, 2), 0.0) * (buoyancy_m_s2_k / grid.spacing_m[2])
    stable_s = _STABLE / jnp.maximum(steeper * own_s, 1e-9)
    ahead_s = jnp.where(steeper > 0, jnp.minimum(pace.ahead * own_s, stable_s), 0.0)
    return ahead_s * face_mean(heating_k_s, 2)
