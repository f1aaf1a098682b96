"""Air whose large eddies are marched: no closure, true time, and supplies whose air is turbulent.

The limited slopes of `core.room.transport` take out what the cells are too coarse for, and no model does (implicit
large-eddy simulation: Grinstein, Margolin and Rider 2007). A jet breaks up only if its air is disturbed. So the air
that flows in also moves along the wall, by a draw of its stated turbulent energy in each cell, anew every chunk of
steps. The result of a march is a mean over time.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
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
    planes = [plane for walls in boundary.walls for wall in walls for plane in wall.tangent_m_s]
    # One draw for all walls: a draw for each takes six times as long to compile.
    drawn = jax.random.normal(jax.random.key(moment), (sum(plane.size for plane in planes),), jnp.float32)
    parts = iter(jnp.split(drawn, np.cumsum([plane.size for plane in planes])[:-1]))

    def at(wall: WallPlane) -> WallPlane:
        # Two of three components carry all of the energy, so that no draw changes the flow through the wall.
        speed_m_s = jnp.sqrt(wall.turbulent_energy_m2_s2)
        first, second = (old + speed_m_s * next(parts).reshape(old.shape) for old in wall.tangent_m_s)
        return eqx.tree_at(lambda w: w.tangent_m_s, wall, (first, second))

    x, y, z = ((at(low), at(high)) for low, high in boundary.walls)
    return Boundary((x, y, z), boundary.solids)
