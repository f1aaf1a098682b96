"""What the six walls do to the air: arrays over each wall's cells, made by `core.room.boundary_conditions`.

A patch covers a fraction f of each cell face. Its volume flow f U is exact then, but its momentum flux
f U^2 is not (f U)^2: the missing U^2 (f - f^2) is a force on the first cells, without which a jet on an
unaligned grid is too weak.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.room.room_grid import AXES, RoomGrid, Velocity, first_plane, last_plane, stored

Plane = Float[Array, "first second"]


class WallPlane(eqx.Module):
    """One wall. Velocities point along the axes; temperatures are in excess of the ambient one.

    `conductance_m_s` is the kinematic heat coefficient q / (rho c dT) over the face, `wall_excess_k` the
    conductance-weighted mean temperature behind it; `no_slip` is 1 for no-slip and 0 for a free surface;
    `held` is the share of the face whose own temperature is known, and shown on its vertices;
    `turbulent_energy_m2_s2` and `dissipation_m2_s3` are those of inflowing air.
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
    """Walls as (low, high) an axis."""

    walls: tuple[tuple[WallPlane, WallPlane], tuple[WallPlane, WallPlane], tuple[WallPlane, WallPlane]]


def closed_wall(grid: RoomGrid, axis: int, no_slip: float = 1.0) -> WallPlane:
    """A wall at rest that no heat passes."""
    zero = jnp.zeros(grid.plane(axis), jnp.float32)
    return WallPlane(zero, (zero, zero), zero, zero, zero, zero, zero, zero, jnp.float32(no_slip), zero + 1.0)


def closed_room(grid: RoomGrid, no_slip: float = 1.0) -> Boundary:
    """Six closed adiabatic walls: the start of every setup."""
    x, y, z = ((closed_wall(grid, a, no_slip), closed_wall(grid, a, no_slip)) for a in AXES)
    return Boundary((x, y, z))


def set_normal(velocity: Velocity, boundary: Boundary) -> Velocity:
    """Velocity with the walls' normal components put in."""
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
    """Two ghost cells beyond each wall: the inflow's value where air comes in, the cell's elsewhere.

    `low` and `high` are (normal velocity, value of inflowing air).
    """
    below = jnp.where(low[0] > 0, low[1], first_plane(field, axis))
    above = jnp.where(high[0] < 0, high[1], last_plane(field, axis))
    below, above = jnp.expand_dims(below, axis), jnp.expand_dims(above, axis)
    return stored(jnp.concatenate([below, below, field, above, above], axis))


def _index(axis: int, plane: int) -> tuple[slice | int, ...]:
    return tuple(plane if a == axis else slice(None) for a in AXES)
