"""Momentum on the faces: advection, the symmetric stress of a variable viscosity, walls, buoyancy, inlets."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.room.room_grid import (
    AXES,
    Cells,
    RoomGrid,
    Velocity,
    closed,
    cut,
    difference,
    face_mean,
    first_plane,
    last_plane,
    stored,
    within,
)
from core.room.solids import Solids
from core.room.transport import add_to_walls, limited_flux
from core.room.wall_planes import Boundary, WallPlane

Field = Float[Array, "..."]


class Viscosity(eqx.Module):
    """Effective viscosity in the cells and on the walls (low, high an axis), molecular part included.

    `on_objects_m2_s` is that on the objects' faces; None where there are none.
    """

    cells_m2_s: Cells
    walls_m2_s: tuple[tuple[Field, Field], ...]
    on_objects_m2_s: Field | None = None


def momentum_rate(
    velocity: Velocity,
    viscosity: Viscosity,
    buoyancy_m_s2: Float[Array, "nx ny inner"],
    boundary: Boundary,
    grid: RoomGrid,
) -> tuple[Field, Field, Field]:
    """du/dt of the inner faces of each component, pressure left out; buoyancy is that at the faces between layers."""
    inside = closed(viscosity.cells_m2_s)
    rates = []
    for a in AXES:
        normal = 2.0 * viscosity.cells_m2_s * difference(velocity[a], a) / grid.spacing_m[a]
        rate = difference(normal - _own_flux(velocity[a], a), a) / grid.spacing_m[a]
        for b in AXES:
            if b != a:
                rate = rate + _across(velocity, inside, boundary, (a, b), grid)
        for b in AXES:
            if b != a:
                rate = add_to_walls(rate, *_friction(velocity[a], viscosity, boundary, (a, b), grid), b)
        if boundary.solids is not None and viscosity.on_objects_m2_s is not None:
            drag = _drag_per_s(viscosity.on_objects_m2_s, boundary.solids, a)
            rate = rate - drag * cut(velocity[a], 1, -1, a)
        rates.append(_with_inlets(rate, boundary.walls[a], a))
    rates[2] = rates[2] + buoyancy_m_s2
    u, v, w = rates
    return u, v, w


def _own_flux(component: Field, axis: int) -> Field:
    """u_a u_a in the cells."""
    edge = [(1, 1) if a == axis else (0, 0) for a in AXES]
    return limited_flux(stored(jnp.pad(component, edge, mode="edge")), face_mean(component, axis), axis)


def _across(
    velocity: Velocity,
    viscosity: Float[Array, "nx2 ny2 nz2"],
    boundary: Boundary,
    axes: tuple[int, int],
    grid: RoomGrid,
) -> Field:
    """d/db (nu (du_a/db + du_b/da) - u_b u_a) at the inner a-faces, the walls' friction left out."""
    a, b = axes
    padded = _padded(velocity[a], boundary, a, b)
    flux = limited_flux(padded, face_mean(velocity[b], a), b)
    strain = (
        difference(cut(padded, 1, -1, b), b) / grid.spacing_m[b]
        + difference(velocity[b], a) / grid.spacing_m[a]
    )
    nu = face_mean(face_mean(within(viscosity, tuple(c for c in AXES if c != b)), a), b)
    if boundary.solids is not None:
        nu = nu * boundary.solids.open_edges[a][b]
    return difference(nu * strain - flux, b) / grid.spacing_m[b]


def _drag_per_s(on_objects_m2_s: Field, solids: Solids, a: int) -> Field:
    """What slows component a at its inner faces, by the friction of the objects beside them."""
    drag = jnp.zeros_like(solids.air)
    for b in AXES:
        if b != a:
            faces = solids.along(b)
            drag = solids.added(drag, on_objects_m2_s[faces] / (2.0 * solids.centre_m[faces] ** 2), faces)
    return face_mean(drag, a)


def _padded(component: Field, boundary: Boundary, a: int, b: int) -> Field:
    """u_a at its inner faces with two ghosts beyond each wall of b."""
    inner = cut(component, 1, -1, a)
    low, high = boundary.walls[b]
    below = _ghost(low, first_plane(inner, b), a, b, inward=1.0)
    above = _ghost(high, last_plane(inner, b), a, b, inward=-1.0)
    below, above = jnp.expand_dims(below, b), jnp.expand_dims(above, b)
    return stored(jnp.concatenate([below, below, inner, above, above], b))


def _ghost(wall: WallPlane, cell: Field, a: int, b: int, *, inward: float) -> Field:
    """Tangential velocity beyond wall b: the inflow's own; mirrored at a wall; continued at a free one."""
    tangent = _on_faces(_tangent(wall, a, b), a, b)
    inflow = _on_faces(wall.normal_m_s, a, b) * inward > 0
    mirrored = wall.no_slip * (2.0 * tangent - cell) + (1.0 - wall.no_slip) * cell
    return jnp.where(inflow, tangent, mirrored)


def _friction(
    component: Field, viscosity: Viscosity, boundary: Boundary, axes: tuple[int, int], grid: RoomGrid
) -> tuple[Field, Field]:
    """du_a/dt of the faces beside the two walls of b, by the walls' friction."""
    a, b = axes
    inner = cut(component, 1, -1, a)
    beside = []
    for side, (wall, nearest) in enumerate(zip(boundary.walls[b], (first_plane, last_plane), strict=True)):
        slip = nearest(inner, b) - _on_faces(_tangent(wall, a, b), a, b)
        nu = _on_faces(viscosity.walls_m2_s[b][side], a, b)
        beside.append(-wall.no_slip * nu * slip / (0.5 * grid.spacing_m[b] ** 2))
    return beside[0], beside[1]


def _with_inlets(rate: Field, walls: tuple[WallPlane, WallPlane], axis: int) -> Field:
    """The rates with the inlets' missing momentum flux, on the first inner faces."""
    first = tuple(0 if a == axis else slice(None) for a in AXES)
    last = tuple(-1 if a == axis else slice(None) for a in AXES)
    return rate.at[first].add(walls[0].force_m_s2).at[last].add(walls[1].force_m_s2)


def _tangent(wall: WallPlane, a: int, b: int) -> Field:
    """The wall's velocity along axis a, on wall b's cells."""
    first, _ = (c for c in AXES if c != b)
    return wall.tangent_m_s[0 if a == first else 1]


def _on_faces(plane: Float[Array, "first second"], a: int, b: int) -> Field:
    """Wall b's cell values at the inner faces of component a: mean of the two cells."""
    first, _ = (c for c in AXES if c != b)
    return face_mean(plane, 0 if a == first else 1)
