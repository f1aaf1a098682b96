"""Air whose large eddies are marched: no closure, true time, and supplies whose air is turbulent.

The limited slopes of `core.room.transport` take out what the cells are too coarse for, and no model does (implicit
large-eddy simulation: Grinstein, Margolin and Rider 2007). A jet breaks up only if its air is disturbed. So the air
that flows in also moves along the wall, by a draw of its stated turbulent energy in each cell, anew every chunk of
steps. The result of a march is a mean over time.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from core.room.closure import AbstractAlgebraicClosure, same_on_walls
from core.room.k_epsilon import KEpsilonState
from core.room.momentum import Viscosity
from core.room.room_grid import RoomGrid, Velocity
from core.room.wall_planes import Boundary, WallPlane


class LargeEddies(AbstractAlgebraicClosure):
    """No eddy viscosity."""

    molecular_m2_s: Float[Array, ""]

    def viscosity(self, state: KEpsilonState | None, velocity: Velocity, grid: RoomGrid) -> Viscosity:
        """The molecular one."""
        return same_on_walls(jnp.full(grid.cells, 1.0) * self.molecular_m2_s)


@eqx.filter_jit
def stirred(boundary: Boundary, moment: Int[Array, ""]) -> Boundary:
    """The walls at this moment, an integer: their supplies' air moves along the wall by a draw for each cell."""
    key = jax.random.key(moment)

    def at(wall: WallPlane, index: int) -> WallPlane:
        # Two of three components carry all of the energy, so that no draw changes the flow through the wall.
        speed_m_s, own = jnp.sqrt(wall.turbulent_energy_m2_s2), jax.random.fold_in(key, index)
        first, second = (
            old + speed_m_s * jax.random.normal(jax.random.fold_in(own, n), old.shape, jnp.float32)
            for n, old in enumerate(wall.tangent_m_s)
        )
        return eqx.tree_at(lambda w: w.tangent_m_s, wall, (first, second))

    x, y, z = ((at(low, 2 * a), at(high, 2 * a + 1)) for a, (low, high) in enumerate(boundary.walls))
    return Boundary((x, y, z), boundary.solids)
