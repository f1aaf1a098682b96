"""Advection by bounded second-order fluxes, and diffusion, in conservative form.

The face value is the upwind cell's plus half of van Leer's harmonic slope: second order where the field
is smooth, first order at extrema, never outside its neighbours (van Leer 1974; Sweby 1984). With forward
Euler in time it is stable below a Courant number of one half, summed over the axes.
"""

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
    within,
)
from core.room.wall_planes import Boundary, inflow_ghosts

Field = Float[Array, "..."]


def limited_flux(padded: Field, normal_m_s: Field, axis: int, open_faces: Field | None = None) -> Field:
    """Flux through the faces between the second to the last but one cell of `padded` along `axis`.

    Slopes across faces that are not open count as zero.
    """
    before, left, right, after = (cut(padded, k, k - 3, axis) for k in range(4))
    forward = normal_m_s > 0
    jump = right - left
    if open_faces is None:
        upwind_jump = jnp.where(forward, left - before, after - right)
    else:
        edge = [(1, 1) if a == axis else (0, 0) for a in AXES]
        beyond = jnp.pad(open_faces, edge)
        lower, upper = cut(beyond, 0, -2, axis), cut(beyond, 2, 0, axis)
        upwind_jump = jnp.where(forward, (left - before) * lower, (after - right) * upper)
    total = upwind_jump + jump
    # Van Leer: 2ab/(a+b) where a and b agree in sign; half of it reaches the face.
    slope = jnp.maximum(upwind_jump * jump, 0.0) / jnp.where(jnp.abs(total) > 1e-20, total, 1e-20)
    return normal_m_s * jnp.where(forward, left + slope, right - slope)


def upwind_flux(padded: Field, normal_m_s: Field, axis: int) -> Field:
    """The same by first-order upwinding: for k and epsilon, which must stay positive."""
    left, right = cut(padded, 1, -2, axis), cut(padded, 2, -1, axis)
    return normal_m_s * jnp.where(normal_m_s > 0, left, right)


def scalar_rate(
    field: Cells,
    inflow: tuple[tuple[Field, Field], ...],
    velocity: Velocity,
    diffusivity_m2_s: Cells,
    boundary: Boundary,
    grid: RoomGrid,
    *,
    limited: bool = True,
) -> Cells:
    """-div(u c) + div(a grad c) without the walls' diffusive flux; `inflow[axis]` is (low, high) values."""
    solids = boundary.solids
    rate = jnp.zeros_like(field)
    diffusivity = closed(diffusivity_m2_s)
    for a in AXES:
        low, high = boundary.walls[a]
        padded = inflow_ghosts(field, (low.normal_m_s, inflow[a][0]), (high.normal_m_s, inflow[a][1]), a)
        faces = None if solids is None else solids.open_faces[a]
        flux = limited_flux(padded, velocity[a], a, faces) if limited else upwind_flux(padded, velocity[a], a)
        gradient = difference(cut(padded, 1, -1, a), a) / grid.spacing_m[a]
        gradient = gradient if faces is None else gradient * faces
        inside = within(diffusivity, tuple(b for b in AXES if b != a))
        rate = rate + difference(face_mean(inside, a) * gradient - flux, a) / grid.spacing_m[a]
    return rate


def wall_heat_rate(
    excess_k: Cells,
    boundary: Boundary,
    factors: tuple[tuple[Field, Field], ...],
    grid: RoomGrid,
    of_objects: Field | None = None,
) -> Cells:
    """Heating of the first cells by their walls [K/s]: h (T_wall - T) / spacing, h times `factors`.

    The same by objects, whose factors are `of_objects`.
    """
    rate = jnp.zeros_like(excess_k)
    for a in AXES:
        low, high = boundary.walls[a]
        below = factors[a][0] * low.conductance_m_s * (low.wall_excess_k - first_plane(excess_k, a))
        above = factors[a][1] * high.conductance_m_s * (high.wall_excess_k - last_plane(excess_k, a))
        rate = add_to_walls(rate, below / grid.spacing_m[a], above / grid.spacing_m[a], a)
    solids = boundary.solids
    if solids is None or of_objects is None:
        return rate
    heat = solids.heat
    apart_k = heat.excess_k - solids.next_air(excess_k)
    flux = heat.flux_k_m_s + of_objects * heat.conductance_m_s * apart_k
    return solids.added(rate, flux / (2.0 * solids.centre_m))


def add_to_walls(field: Cells, below: Field, above: Field, axis: int) -> Cells:
    """`field` with planes added to the cells beside the two walls of an axis."""
    low = tuple(0 if a == axis else slice(None) for a in AXES)
    high = tuple(-1 if a == axis else slice(None) for a in AXES)
    return field.at[low].add(below).at[high].add(above)
