"""The boundary conditions as arrays over the cells of the six walls (made by `core.room.boundary_conditions`).

A patch covers a fraction f of a cell's face. The face's volume flow f U is exact, but its momentum flux is f U^2,
not (f U)^2. The difference U^2 (f - f^2) is added as a force on the first cells; without it jets from partly
covered faces are too weak.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.room.room_grid import AXES, RoomGrid, Velocity, first_plane, last_plane, stored
from core.room.solids import Solids

Plane = Float[Array, "first second"]


class WallPlane(eqx.Module):
    """One wall. Velocities point along the axes; temperatures are in excess of the ambient one.

    `conductance_m_s` is the kinematic heat coefficient q / (rho c dT), and `wall_excess_k` the wall's temperature,
    weighted with it where several parts share a face. `no_slip` is 1 for a no-slip wall and 0 for a free surface.
    `held` is the share of the face that has a temperature of its own, stated or fitted, which its vertices show.
    `turbulent_energy_m2_s2` and `dissipation_m2_s3` are those of the air that flows in.
    """

    normal_m_s: Plane
    tangent_m_s: tuple[Plane, Plane]
    inflow_excess_k: Plane
    force_m_s2: Plane
    conductance_m_s: Plane
    wall_excess_k: Plane
    turbulent_energy_m2_s2: Plane
    dissipation_m2_s3: Plane
    no_slip: Float[Array, ""]
    held: Plane


class Boundary(eqx.Module):
    """Walls as (low, high) an axis, and the objects in the room; None where there are none."""

    walls: tuple[tuple[WallPlane, WallPlane], tuple[WallPlane, WallPlane], tuple[WallPlane, WallPlane]]
    solids: Solids | None = None


def closed_wall(grid: RoomGrid, axis: int, no_slip: float = 1.0) -> WallPlane:
    """An adiabatic wall without openings."""
    zero = jnp.zeros(grid.plane(axis), jnp.float32)
    return WallPlane(zero, (zero, zero), zero, zero, zero, zero, zero, zero, jnp.float32(no_slip), zero + 1.0)


def closed_room(grid: RoomGrid, no_slip: float = 1.0) -> Boundary:
    """Six adiabatic walls without openings."""
    x, y, z = ((closed_wall(grid, a, no_slip), closed_wall(grid, a, no_slip)) for a in AXES)
    return Boundary((x, y, z))


def set_normal(velocity: Velocity, boundary: Boundary) -> Velocity:
    """`velocity` with the walls' normal components set."""
    u, v, w = (
        velocity[a]
        .at[_index(a, 0)]
        .set(boundary.walls[a][0].normal_m_s)
        .at[_index(a, -1)]
        .set(boundary.walls[a][1].normal_m_s)
        for a in AXES
    )
    return u, v, w


def inflow_ghosts(
    field: Float[Array, "nx ny nz"], low: tuple[Plane, Plane], high: tuple[Plane, Plane], axis: int
) -> Float[Array, "..."]:
    """The field with two ghost cells beyond each wall: the inflow's value where air enters, else the cell's.

    `low` and `high` are (normal velocity, value of inflowing air).
    """
    below = jnp.where(low[0] > 0, low[1], first_plane(field, axis))
    above = jnp.where(high[0] < 0, high[1], last_plane(field, axis))
    below, above = jnp.expand_dims(below, axis), jnp.expand_dims(above, axis)
    return stored(jnp.concatenate([below, below, field, above, above], axis))


def _index(axis: int, plane: int) -> tuple[slice | int, ...]:
    return tuple(plane if a == axis else slice(None) for a in AXES)
