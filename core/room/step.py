"""One explicit step of the Boussinesq equations on the staggered grid.

    du/dt + div(u u) = -grad p + div(nu_eff (grad u + grad u^T)) + g beta T e_z,   div u = 0
    dT/dt + div(u T) = div(alpha_eff grad T),      T in excess of the ambient temperature

Temperature first, so that its buoyancy drives the velocity of the same step. Cost: about 300 floating
point operations a cell and step and 12 n^4 of matrix products for the pressure; memory: about 60 fields.
Stable at the steps of `own_pace`; first order in time, second order in space where the fields are smooth.

The pressure is that of the last step plus what is still missing. So steady air is the same however long each cell's
step is (`core.room.pace`).
"""

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int

from core.air import Air
from core.room.closure import AbstractClosure
from core.room.k_epsilon import TURBULENT_PRANDTL, KEpsilonState
from core.room.momentum import Viscosity, momentum_rate
from core.room.obstructed import ObstructedSolver, obstructed_solver, project_obstructed
from core.room.pace import Pace, StepLimits, pace_of, wave_damping_k
from core.room.pressure import PressureSolver, pressure_solver, project
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
    with_walls,
)
from core.room.transport import add_to_walls, scalar_rate, wall_heat_rate
from core.room.wall_planes import Boundary, set_normal


class Flow(eqx.Module):
    """The state of the air: temperature in excess of the ambient one, kinematic pressure of zero mean."""

    velocity: Velocity
    excess_k: Cells
    pressure_m2_s2: Cells
    turbulence: KEpsilonState | None


class RoomModel(eqx.Module):
    """Everything that a step needs; `log_viscosity` adds to the logarithm of the closure's viscosity."""

    grid: RoomGrid
    boundary: Boundary
    closure: AbstractClosure
    pressure: PressureSolver | ObstructedSolver
    buoyancy_m_s2_k: Float[Array, ""]
    molecular_m2_s: Float[Array, ""]
    prandtl: Float[Array, ""]
    turbulent_prandtl: Float[Array, ""]
    log_viscosity: Cells

    def viscosity(self, flow: Flow) -> Viscosity:
        """The closure's viscosity, its eddy part times exp(log_viscosity) in the cells."""
        raw = self.closure.viscosity(flow.turbulence, flow.velocity, self.grid)
        eddy = (raw.cells_m2_s - self.molecular_m2_s) * jnp.exp(self.log_viscosity)
        cells, solids = eddy + self.molecular_m2_s, self.boundary.solids
        if solids is None:
            return Viscosity(cells, raw.walls_m2_s)
        on_objects = self.closure.object_viscosity_m2_s(flow.turbulence, cells, solids)
        return Viscosity(cells, raw.walls_m2_s, on_objects)

    def diffusivity_m2_s(self, viscosity: Viscosity) -> Cells:
        """nu / Pr + nu_t / Pr_t."""
        eddy = viscosity.cells_m2_s - self.molecular_m2_s
        return self.molecular_m2_s / self.prandtl + eddy / self.turbulent_prandtl


def room_model(
    grid: RoomGrid,
    boundary: Boundary,
    closure: AbstractClosure,
    *,
    buoyancy_m_s2_k: float,
    molecular_m2_s: float,
    prandtl: float = Air().prandtl,
) -> RoomModel:
    """A model with its pressure solver made."""
    return RoomModel(
        grid,
        boundary,
        closure,
        pressure_solver(grid) if boundary.solids is None else obstructed_solver(grid, boundary.solids),
        jnp.float32(buoyancy_m_s2_k),
        jnp.float32(molecular_m2_s),
        jnp.float32(prandtl),
        jnp.float32(TURBULENT_PRANDTL),
        jnp.zeros(grid.cells, jnp.float32),
    )


def air_at_rest(model: RoomModel, excess_k: Cells, speed_m_s: float) -> Flow:
    """No motion but the walls' own; `speed_m_s` sets the closure's first guess."""
    u, v, w = (jnp.zeros([n + (a == b) for b, n in enumerate(model.grid.cells)], jnp.float32) for a in AXES)
    velocity = set_normal((u, v, w), model.boundary)
    turbulence = model.closure.start(model.grid, speed_m_s)
    return Flow(velocity, excess_k, jnp.zeros_like(excess_k), turbulence)


def step(flow: Flow, viscosity: Viscosity, model: RoomModel, pace: Pace) -> Flow:
    """The flow after each cell's step, turbulence unchanged."""
    grid, boundary = model.grid, model.boundary
    factors = model.closure.wall_heat(flow.turbulence, grid)
    solids = boundary.solids
    of_objects = None if solids is None else model.closure.object_heat(flow.turbulence, solids)
    inflow = tuple((low.inflow_excess_k, high.inflow_excess_k) for low, high in boundary.walls)
    heating = scalar_rate(
        flow.excess_k, inflow, flow.velocity, model.diffusivity_m2_s(viscosity), boundary, grid
    ) + wall_heat_rate(flow.excess_k, boundary, factors, grid, of_objects)
    excess_k = flow.excess_k + pace.own_s * heating
    soon_k = face_mean(excess_k, 2) + wave_damping_k(excess_k, heating, model.buoyancy_m_s2_k, pace, grid)
    rates = momentum_rate(flow.velocity, viscosity, model.buoyancy_m_s2_k * soon_k, boundary, grid)
    u, v, w = (
        _advance_inner(
            flow.velocity[a], pace.faces_s(a) * (rates[a] - _slope(flow.pressure_m2_s2, a, grid)), a
        )
        for a in AXES
    )
    solver = model.pressure
    if isinstance(solver, PressureSolver):
        velocity, missing = project((u, v, w), pace.shortest_s, grid, solver)
    else:
        velocity, missing = project_obstructed((u, v, w), pace.shortest_s, grid, solver)
    return Flow(velocity, excess_k, flow.pressure_m2_s2 + missing / pace.longer, flow.turbulence)


def two_steps(flow: Flow, model: RoomModel, pace: Pace) -> Flow:
    """Two steps under one update of the turbulence, which is slower than the flow."""
    turbulence = model.closure.advance(
        flow.turbulence, flow.velocity, model.boundary, model.grid, 2.0 * pace.own_s
    )
    viscosity = model.viscosity(Flow(flow.velocity, flow.excess_k, flow.pressure_m2_s2, turbulence))

    def once(_: Int[Array, ""], air: tuple[Velocity, Cells, Cells]) -> tuple[Velocity, Cells, Cells]:
        velocity, excess_k, pressure_m2_s2 = air
        after = step(Flow(velocity, excess_k, pressure_m2_s2, turbulence), viscosity, model, pace)
        return after.velocity, after.excess_k, after.pressure_m2_s2

    # A loop compiles the step once; turbulence stays out of what it carries, and is not copied.
    start = flow.velocity, flow.excess_k, flow.pressure_m2_s2
    velocity, excess_k, pressure_m2_s2 = lax.fori_loop(0, 2, once, start)
    return Flow(velocity, excess_k, pressure_m2_s2, turbulence)


def own_pace(flow: Flow, model: RoomModel, limits: StepLimits) -> Pace:
    """Stable steps: the Courant number summed over the axes, a cell's own weight not below 0, and slow acceleration.

    What diffuses out of a cell in a step is at most what it holds: 2 D dt (1/hx^2 + 1/hy^2 + 1/hz^2) <= 1. Buoyancy
    moves air that was at rest by less than a cell: g beta (T_max - T_min) dt^2 / 2 <= h.
    """
    grid = model.grid
    rate = sum(
        jnp.maximum(jnp.abs(cut(flow.velocity[a], 0, -1, a)), jnp.abs(cut(flow.velocity[a], 1, 0, a)))
        / grid.spacing_m[a]
        for a in AXES
    ) + _sliding_rate(model)
    viscosity = model.viscosity(flow)
    diffusive = jnp.maximum(viscosity.cells_m2_s, model.diffusivity_m2_s(viscosity))
    curvature = sum(1.0 / h**2 for h in grid.spacing_m)
    contrast_k = jnp.max(flow.excess_k) - jnp.min(flow.excess_k)
    falling = jnp.sqrt(0.5 * jnp.abs(model.buoyancy_m_s2_k) * contrast_k / grid.spacing_m[2])
    return pace_of(rate / limits.courant + 2.0 * curvature * diffusive + falling + 1e-6, limits)


def _sliding_rate(model: RoomModel) -> Cells:
    """Courant rate [1/s] beside walls that slide: a lid drives air that is still at rest."""
    grid = model.grid
    rate = jnp.zeros(grid.cells, jnp.float32)
    for a in AXES:
        first_m, second_m = (grid.spacing_m[b] for b in AXES if b != a)
        below, above = (
            jnp.abs(wall.tangent_m_s[0]) / first_m + jnp.abs(wall.tangent_m_s[1]) / second_m
            for wall in model.boundary.walls[a]
        )
        rate = add_to_walls(rate, below, above, a)
    return rate


def _slope(field: Cells, axis: int, grid: RoomGrid) -> Float[Array, "..."]:
    return difference(field, axis) / grid.spacing_m[axis]


def _advance_inner(
    component: Float[Array, "..."], change: Float[Array, "..."], axis: int
) -> Float[Array, "..."]:
    inner = cut(component, 1, -1, axis) + change
    return with_walls(first_plane(component, axis), inner, last_plane(component, axis), axis)
