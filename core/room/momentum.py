"""Momentum on the faces: advection, the symmetric stress of a variable viscosity, walls, buoyancy, inlets."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.room.boundary import Boundary, WallPlane
from core.room.grid import (
    AXES,
    Cells,
    RoomGrid,
    Velocity,
    cut,
    difference,
    face_mean,
    first_plane,
    last_plane,
    stored,
    with_walls,
)
from core.room.transport import limited_flux

Field = Float[Array, "..."]


class Viscosity(eqx.Module):
    """Effective viscosity in the cells and on the walls (low, high an axis), molecular part included."""

    cells_m2_s: Cells
    walls_m2_s: tuple[tuple[Field, Field], ...]


def momentum_rate(
    velocity: Velocity,
    viscosity: Viscosity,
    buoyancy_m_s2: Cells,
    boundary: Boundary,
    grid: RoomGrid,
) -> tuple[Field, Field, Field]:
    """du/dt of the inner faces of each component, pressure left out."""
    shear = {
        (a, b): stored(_inner_shear(velocity, viscosity.cells_m2_s, a, b, grid))
        for a, b in ((0, 1), (0, 2), (1, 2))
    }
    rates = []
    for a in AXES:
        normal = 2.0 * viscosity.cells_m2_s * difference(velocity[a], a) / grid.spacing_m[a]
        rate = difference(stored(normal - _own_flux(velocity[a], a)), a) / grid.spacing_m[a]
        for b in AXES:
            if b != a:
                inner = shear[min(a, b), max(a, b)]
                stress = _walled_shear(inner, velocity, viscosity, boundary, (a, b), grid)
                flux = stored(stress - _cross_flux(velocity, boundary, a, b))
                rate = rate + difference(flux, b) / grid.spacing_m[b]
        rates.append(_with_inlets(rate, boundary.walls[a], a))
    rates[2] = rates[2] + face_mean(buoyancy_m_s2, 2)
    u, v, w = rates
    return u, v, w


def _own_flux(component: Field, axis: int) -> Field:
    """u_a u_a in the cells."""
    edge = [(1, 1) if a == axis else (0, 0) for a in AXES]
    return limited_flux(stored(jnp.pad(component, edge, mode="edge")), face_mean(component, axis), axis)


def _cross_flux(velocity: Velocity, boundary: Boundary, a: int, b: int) -> Field:
    """u_b u_a on the edges between the inner a-faces, walls of b included."""
    inner = cut(velocity[a], 1, -1, a)
    carrier = face_mean(velocity[b], a)
    low, high = boundary.walls[b]
    below = _ghost(low, first_plane(inner, b), a, b, inward=1.0)
    above = _ghost(high, last_plane(inner, b), a, b, inward=-1.0)
    below, above = jnp.expand_dims(below, b), jnp.expand_dims(above, b)
    return limited_flux(stored(jnp.concatenate([below, below, inner, above, above], b)), carrier, b)


def _ghost(wall: WallPlane, cell: Field, a: int, b: int, *, inward: float) -> Field:
    """Tangential velocity beyond wall b: the inflow's own; mirrored at a wall; continued at a free one."""
    tangent = _on_faces(_tangent(wall, a, b), a, b)
    inflow = _on_faces(wall.normal_m_s, a, b) * inward > 0
    mirrored = wall.grip * (2.0 * tangent - cell) + (1.0 - wall.grip) * cell
    return jnp.where(inflow, tangent, mirrored)


def _inner_shear(velocity: Velocity, viscosity: Cells, a: int, b: int, grid: RoomGrid) -> Field:
    """nu (du_a/db + du_b/da) on the inner edges of the plane a, b."""
    gradient = (
        difference(cut(velocity[a], 1, -1, a), b) / grid.spacing_m[b]
        + difference(cut(velocity[b], 1, -1, b), a) / grid.spacing_m[a]
    )
    return face_mean(face_mean(viscosity, a), b) * gradient


def _walled_shear(
    inner: Field,
    velocity: Velocity,
    viscosity: Viscosity,
    boundary: Boundary,
    axes: tuple[int, int],
    grid: RoomGrid,
) -> Field:
    """Shear on component a between the walls of b: `inner` closed by the two walls' friction."""
    a, b = axes
    component = cut(velocity[a], 1, -1, a)
    planes = []
    for side, (wall, nearest) in enumerate(zip(boundary.walls[b], (first_plane, last_plane), strict=True)):
        slip = nearest(component, b) - _on_faces(_tangent(wall, a, b), a, b)
        nu = _on_faces(viscosity.walls_m2_s[b][side], a, b)
        stress = wall.grip * nu * slip / (0.5 * grid.spacing_m[b])
        planes.append(stress if side == 0 else -stress)
    return with_walls(planes[0], inner, planes[1], b)


def _with_inlets(rate: Field, walls: tuple[WallPlane, WallPlane], axis: int) -> Field:
    """The inlets' missing momentum flux, given to the first inner faces."""
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
