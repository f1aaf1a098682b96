"""The k-epsilon model on cells, with wall functions (Launder and Spalding 1974).

    dk/dt   + u.grad k   = div((nu + nu_t) grad k)         + G - epsilon
    deps/dt + u.grad eps = div((nu + nu_t / 1.3) grad eps) + (1.44 G - 1.92 eps) eps / k
    nu_t = 0.09 k^2 / eps,   G = 2 nu_t S:S

Beside walls, y the distance of the first cell's centre: eps = C^(3/4) k^(3/2) / (kappa y) is set,
G = nu_w |u| / y C^(1/4) sqrt(k) / (kappa y), nu_w = nu y+ kappa / ln(E y+), averaged over the walls that a
cell touches. Sources are taken implicitly, so both stay positive at any step. First-order upwind.

Where hardly anything feeds turbulence k^2 / eps would grow without end, since eps decays faster than k. So no eddy is
larger than the log law allows in the middle between two walls: C^(3/4) k^(3/2) / eps <= kappa h / 2, with h the
room's smallest size between walls.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.room.room_grid import (
    AXES,
    Cells,
    RoomGrid,
    Velocity,
    cut,
    difference,
    face_mean,
    first_plane,
    last_plane,
)
from core.room.solids import Solids
from core.room.transport import add_to_walls, scalar_rate
from core.room.wall_planes import Boundary

C_MU, C_1, C_2, SIGMA_EPSILON = 0.09, 1.44, 1.92, 1.3
KAPPA, WALL_E, LAMINAR_Y_PLUS = 0.41, 9.8, 11.53
# Of free convection along a wall: 1.6 W/m2K over rho c.
NOMINAL_HEAT_M_S = 1.35e-3
TURBULENT_PRANDTL = 0.85
SMALLEST_K, SMALLEST_EPSILON = 1e-9, 1e-12


class KEpsilonState(eqx.Module):
    """Turbulent energy and its dissipation."""

    energy_m2_s2: Cells
    dissipation_m2_s3: Cells

    def eddy_m2_s(self) -> Cells:
        """nu_t."""
        return C_MU * self.energy_m2_s2**2 / self.dissipation_m2_s3


def advance(
    state: KEpsilonState,
    velocity: Velocity,
    boundary: Boundary,
    grid: RoomGrid,
    own_s: Cells,
    molecular_m2_s: Float[Array, ""],
    scale: Float[Array, ""],
) -> KEpsilonState:
    """k and epsilon after each cell's step."""
    k, epsilon = state.energy_m2_s2, state.dissipation_m2_s3
    eddy = scale * state.eddy_m2_s()
    # The division last: XLA keeps its result for both equations, and would work a product out twice.
    production = scale * C_MU * k**2 * strain_squared(velocity, grid) / epsilon
    touched, wall_production, wall_epsilon = wall_sources(k, velocity, boundary, grid, molecular_m2_s)
    production = jnp.where(touched > 0, wall_production, production)
    inflow_k = tuple(
        (low.turbulent_energy_m2_s2, high.turbulent_energy_m2_s2) for low, high in boundary.walls
    )
    inflow_e = tuple((low.dissipation_m2_s3, high.dissipation_m2_s3) for low, high in boundary.walls)
    k_rate = scalar_rate(k, inflow_k, velocity, molecular_m2_s + eddy, boundary, grid, limited=False)
    e_rate = scalar_rate(
        epsilon, inflow_e, velocity, molecular_m2_s + eddy / SIGMA_EPSILON, boundary, grid, limited=False
    )
    frequency = epsilon / k
    new_k = (k + own_s * (k_rate + production)) / (1.0 + own_s * frequency)
    new_e = (epsilon + own_s * (e_rate + C_1 * production * frequency)) / (1.0 + own_s * C_2 * frequency)
    new_e = jnp.maximum(new_e, C_MU**0.75 * new_k**1.5 / largest_eddy_m(boundary, grid))
    new_e = jnp.where(touched > 0, wall_epsilon, new_e)
    if boundary.solids is not None:
        new_k, new_e = new_k * boundary.solids.air, new_e * boundary.solids.air
    return KEpsilonState(jnp.maximum(new_k, SMALLEST_K), jnp.maximum(new_e, SMALLEST_EPSILON))


def largest_eddy_m(boundary: Boundary, grid: RoomGrid) -> Float[Array, ""]:
    """The log law's mixing length in the middle between the two walls that are nearest to one another.

    Free surfaces are no walls: air between two of them may be as thin as one likes.
    """
    between = [
        grid.cells[a] * grid.spacing_m[a] / jnp.maximum(jnp.maximum(low.no_slip, high.no_slip), 1e-6)
        for a, (low, high) in enumerate(boundary.walls)
    ]
    return KAPPA * 0.5 * jnp.min(jnp.stack(between))


def strain_squared(velocity: Velocity, grid: RoomGrid) -> Cells:
    """2 S:S in the cells; cross gradients from velocities averaged to cells."""
    total = sum(2.0 * (difference(velocity[a], a) / grid.spacing_m[a]) ** 2 for a in AXES)
    cells = [face_mean(velocity[a], a) for a in AXES]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        total = total + (_central(cells[a], b, grid) + _central(cells[b], a, grid)) ** 2
    return jnp.asarray(total)


def wall_sources(
    k: Cells, velocity: Velocity, boundary: Boundary, grid: RoomGrid, molecular_m2_s: Float[Array, ""]
) -> tuple[Cells, Cells, Cells]:
    """Number of walls that each cell touches, free surfaces apart, and there the production and epsilon.

    Openings count as walls. A supply has an epsilon of its own, but its edge is smeared over a cell at 48 across a
    room, and with that epsilon the jet spreads too much: case A's velocity is then 0.151 off instead of 0.128.
    """
    cells = [face_mean(velocity[a], a) for a in AXES]
    touched = jnp.zeros_like(k)
    production, epsilon = jnp.zeros_like(k), jnp.zeros_like(k)
    walls = energy_walls(k, grid, molecular_m2_s)
    for a in AXES:
        y = 0.5 * grid.spacing_m[a]
        parts, grips = [], [jnp.full(grid.plane(a), wall.no_slip) for wall in boundary.walls[a]]
        for side, nearest in enumerate((first_plane, last_plane)):
            b, c = (other for other in AXES if other != a)
            speed = jnp.sqrt(nearest(cells[b], a) ** 2 + nearest(cells[c], a) ** 2 + 1e-12)
            root = jnp.sqrt(nearest(k, a))
            rate = C_MU**0.25 * root / (KAPPA * y)
            no_slip = grips[side]
            parts.append(
                (no_slip * walls[a][side] * speed / y * rate, no_slip * C_MU**0.75 * root**3 / (KAPPA * y))
            )
        production = add_to_walls(production, parts[0][0], parts[1][0], a)
        epsilon = add_to_walls(epsilon, parts[0][1], parts[1][1], a)
        touched = add_to_walls(touched, grips[0], grips[1], a)
    if boundary.solids is not None:
        found = _object_sources(k, cells, boundary.solids, molecular_m2_s)
        touched, production, epsilon = (
            boundary.solids.added(field, values)
            for field, values in zip((touched, production, epsilon), found, strict=True)
        )
    weight = 1.0 / jnp.maximum(touched, 1.0)
    return touched, production * weight, epsilon * weight


def _object_sources(
    k: Cells, cells: list[Float[Array, "..."]], solids: Solids, molecular_m2_s: Float[Array, ""]
) -> tuple[Float[Array, " faces"], Float[Array, " faces"], Float[Array, " faces"]]:
    """The same of the objects' faces: 1 for each, production and epsilon in the air beside it."""
    beside_k, y = solids.next_air(k), solids.centre_m
    speeds = []
    for a in AXES:
        b, c = (cells[other].reshape(-1)[solids.beside[solids.along(a)]] for other in AXES if other != a)
        speeds.append(jnp.sqrt(b**2 + c**2 + 1e-12))
    root = jnp.sqrt(beside_k)
    rate = C_MU**0.25 * root / (KAPPA * y)
    production = energy_viscosity(beside_k, y, molecular_m2_s) * jnp.concatenate(speeds) / y * rate
    return jnp.ones_like(y), production, C_MU**0.75 * root**3 / (KAPPA * y)


def energy_viscosity(
    k: Float[Array, "..."], y_m: Float[Array, "..."] | float, molecular_m2_s: Float[Array, ""]
) -> Float[Array, "..."]:
    """Viscosity on a wall by the log law, from k at the distance y."""
    y_plus = C_MU**0.25 * jnp.sqrt(k) * y_m / molecular_m2_s
    log_law = y_plus * KAPPA / jnp.log(jnp.maximum(WALL_E * y_plus, 2.0))
    return molecular_m2_s * jnp.where(y_plus > LAMINAR_Y_PLUS, log_law, 1.0)


def heat_ratio(
    k: Float[Array, "..."],
    y_m: Float[Array, "..."] | float,
    molecular_m2_s: Float[Array, ""],
    prandtl: float,
) -> Float[Array, "..."]:
    """Heat coefficient of a wall over the nominal one, from k at the distance y (`heat_walls`)."""
    ratio = prandtl / TURBULENT_PRANDTL
    sublayer = 9.24 * (ratio**0.75 - 1.0) * (1.0 + 0.28 * np.exp(-0.007 * prandtl / TURBULENT_PRANDTL))
    friction = C_MU**0.25 * jnp.sqrt(k)
    y_plus = friction * y_m / molecular_m2_s
    profile = jnp.log(jnp.maximum(WALL_E * y_plus, 40.0)) / KAPPA + sublayer
    heat = jnp.maximum(friction / (TURBULENT_PRANDTL * profile), molecular_m2_s / (prandtl * y_m))
    return jnp.maximum(heat / NOMINAL_HEAT_M_S, 0.5)


def energy_walls(
    k: Cells, grid: RoomGrid, molecular_m2_s: Float[Array, ""]
) -> tuple[tuple[Float[Array, "..."], Float[Array, "..."]], ...]:
    """Viscosity on the walls by the log law from k beside them (low, high an axis)."""
    walls = []
    for a in AXES:
        y = 0.5 * grid.spacing_m[a]
        sides = []
        for nearest in (first_plane, last_plane):
            sides.append(energy_viscosity(nearest(k, a), y, molecular_m2_s))
        walls.append((sides[0], sides[1]))
    return tuple(walls)


def heat_walls(
    k: Cells, grid: RoomGrid, molecular_m2_s: Float[Array, ""], prandtl: float
) -> tuple[tuple[Float[Array, "..."], Float[Array, "..."]], ...]:
    """Heat coefficient of the walls over the nominal one of free convection, (low, high) for each axis.

    Jayatilleke's wall function; but at least conduction through half a cell, and half of the nominal coefficient.
    A jet along a wall takes up several times the heat of a still corner.
    """
    walls = []
    for a in AXES:
        y = 0.5 * grid.spacing_m[a]
        sides = []
        for nearest in (first_plane, last_plane):
            sides.append(heat_ratio(nearest(k, a), y, molecular_m2_s, prandtl))
        walls.append((sides[0], sides[1]))
    return tuple(walls)


def _central(cells: Cells, axis: int, grid: RoomGrid) -> Cells:
    """Central difference along `axis`, one-sided beside walls."""
    edge = [(1, 1) if a == axis else (0, 0) for a in AXES]
    padded = jnp.pad(cells, edge, mode="edge")
    return (cut(padded, 2, 0, axis) - cut(padded, 0, -2, axis)) / (2.0 * grid.spacing_m[axis])
