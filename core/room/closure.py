"""Turbulence closures: the eddy viscosity that stands for motion smaller than the mean flow.

    constant       nu_t given (momentum and heat)
    zero_equation  nu_t = 0.03874 |u| l, l the distance to the nearest wall   (Chen and Xu 1998)
    k_epsilon      standard constants with wall functions                     (Launder and Spalding 1974)

A closure has a state (none, or k and epsilon), advances it in time, and gives the effective viscosity in the cells
and on the walls. k-epsilon has no buoyancy term in the equations of k and epsilon.
"""

import abc
from typing import cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy import ndimage

from core.air import Air
from core.room.k_epsilon import (
    C_MU,
    KEpsilonState,
    advance,
    energy_viscosity,
    energy_walls,
    heat_ratio,
    heat_walls,
)
from core.room.momentum import Viscosity
from core.room.room_grid import AXES, Cells, RoomGrid, Velocity, face_mean, first_plane, last_plane
from core.room.solids import Faces, Solids
from core.room.wall_planes import Boundary, Plane


class AbstractClosure(eqx.Module):
    """A closure; `start` makes its first state."""

    @abc.abstractmethod
    def start(self, grid: RoomGrid, speed_m_s: float) -> KEpsilonState | None:
        """The first state, of still air in a room with the velocity scale `speed_m_s`."""

    @abc.abstractmethod
    def advance(
        self,
        state: KEpsilonState | None,
        velocity: Velocity,
        boundary: Boundary,
        grid: RoomGrid,
        own_s: Cells,
    ) -> KEpsilonState | None:
        """The state after `own_s`."""

    @abc.abstractmethod
    def viscosity(self, state: KEpsilonState | None, velocity: Velocity, grid: RoomGrid) -> Viscosity:
        """Effective viscosity, molecular part included."""

    @abc.abstractmethod
    def wall_heat(self, state: KEpsilonState | None, grid: RoomGrid) -> tuple[tuple[Plane, Plane], ...]:
        """Factors on the walls' conductances, (low, high) for each axis."""

    @abc.abstractmethod
    def object_viscosity_m2_s(self, state: KEpsilonState | None, cells_m2_s: Cells, solids: Solids) -> Faces:
        """Viscosity on the objects' faces, from that in the cells."""

    @abc.abstractmethod
    def object_heat(self, state: KEpsilonState | None, solids: Solids) -> Faces:
        """Factors on the objects' conductances."""


class AbstractAlgebraicClosure(AbstractClosure):
    """A closure without a state of its own: its viscosity follows from the velocity, its walls are as stated."""

    def start(self, grid: RoomGrid, speed_m_s: float) -> KEpsilonState | None:
        """No state."""
        return None

    def advance(
        self,
        state: KEpsilonState | None,
        velocity: Velocity,
        boundary: Boundary,
        grid: RoomGrid,
        own_s: Cells,
    ) -> KEpsilonState | None:
        """No state."""
        return None

    def wall_heat(self, state: KEpsilonState | None, grid: RoomGrid) -> tuple[tuple[Plane, Plane], ...]:
        """The stated conductances."""
        return _even_walls(grid)

    def object_viscosity_m2_s(self, state: KEpsilonState | None, cells_m2_s: Cells, solids: Solids) -> Faces:
        """That of the air beside."""
        return solids.next_air(cells_m2_s)

    def object_heat(self, state: KEpsilonState | None, solids: Solids) -> Faces:
        """The stated conductances."""
        return jnp.ones_like(solids.centre_m)


class ConstantClosure(AbstractAlgebraicClosure):
    """One eddy viscosity everywhere, on walls too; zero for laminar flow."""

    eddy_m2_s: Float[Array, ""]
    molecular_m2_s: Float[Array, ""]

    def viscosity(self, state: KEpsilonState | None, velocity: Velocity, grid: RoomGrid) -> Viscosity:
        """The constant."""
        return same_on_walls(jnp.full(grid.cells, 1.0) * (self.eddy_m2_s + self.molecular_m2_s))


class ZeroEquationClosure(AbstractAlgebraicClosure):
    """Chen and Xu (1998): local speed times wall distance; `scale` multiplies their 0.03874."""

    wall_distance_m: Cells
    scale: Float[Array, ""]
    molecular_m2_s: Float[Array, ""]

    def viscosity(self, state: KEpsilonState | None, velocity: Velocity, grid: RoomGrid) -> Viscosity:
        """0.03874 |u| l plus the molecular one."""
        u, v, w = (face_mean(velocity[a], a) for a in AXES)
        speed = jnp.sqrt(u**2 + v**2 + w**2)
        return same_on_walls(0.03874 * self.scale * speed * self.wall_distance_m + self.molecular_m2_s)


class KEpsilonClosure(AbstractClosure):
    """Standard k-epsilon; `scale` multiplies C_mu's viscosity in the cells."""

    scale: Float[Array, ""]
    molecular_m2_s: Float[Array, ""]
    prandtl: float = eqx.field(static=True, default=Air().prandtl)

    def start(self, grid: RoomGrid, speed_m_s: float) -> KEpsilonState | None:
        """k from 10 % of the speed, epsilon so that nu_t is 30 times the molecular viscosity."""
        k = jnp.full(grid.cells, 1.5 * (0.1 * speed_m_s) ** 2, jnp.float32)
        return KEpsilonState(k, C_MU * k**2 / (30.0 * self.molecular_m2_s))

    def advance(
        self,
        state: KEpsilonState | None,
        velocity: Velocity,
        boundary: Boundary,
        grid: RoomGrid,
        own_s: Cells,
    ) -> KEpsilonState | None:
        """One step of both equations."""
        if state is None:
            return None
        return advance(state, velocity, boundary, grid, own_s, self.molecular_m2_s, self.scale)

    def viscosity(self, state: KEpsilonState | None, velocity: Velocity, grid: RoomGrid) -> Viscosity:
        """C_mu k^2 / epsilon, and the log law on walls."""
        if state is None:
            return same_on_walls(jnp.full(grid.cells, 1.0) * self.molecular_m2_s)
        cells = self.scale * state.eddy_m2_s() + self.molecular_m2_s
        return Viscosity(cells, energy_walls(state.energy_m2_s2, grid, self.molecular_m2_s))

    def wall_heat(self, state: KEpsilonState | None, grid: RoomGrid) -> tuple[tuple[Plane, Plane], ...]:
        """The wall function's heat coefficient over the nominal one."""
        if state is None:
            return _even_walls(grid)
        return heat_walls(state.energy_m2_s2, grid, self.molecular_m2_s, self.prandtl)

    def object_viscosity_m2_s(self, state: KEpsilonState | None, cells_m2_s: Cells, solids: Solids) -> Faces:
        """The log law."""
        if state is None:
            return solids.next_air(cells_m2_s)
        return energy_viscosity(solids.next_air(state.energy_m2_s2), solids.centre_m, self.molecular_m2_s)

    def object_heat(self, state: KEpsilonState | None, solids: Solids) -> Faces:
        """The wall function's heat coefficient over the nominal one."""
        if state is None:
            return jnp.ones_like(solids.centre_m)
        beside = solids.next_air(state.energy_m2_s2)
        return heat_ratio(beside, solids.centre_m, self.molecular_m2_s, self.prandtl)


def wall_distance_m(grid: RoomGrid, solids: Solids | None = None) -> Cells:
    """Distance of each cell centre to the nearest wall of the box, or object."""
    distance = jnp.full(grid.cells, jnp.inf, jnp.float32)
    for a in AXES:
        centres = (jnp.arange(grid.cells[a], dtype=jnp.float32) + 0.5) * grid.spacing_m[a]
        nearest = jnp.minimum(centres, grid.cells[a] * grid.spacing_m[a] - centres)
        distance = jnp.minimum(distance, nearest.reshape([-1 if b == a else 1 for b in AXES]))
    if solids is None:
        return distance
    to_centre_m = cast(
        "np.ndarray", ndimage.distance_transform_edt(np.asarray(solids.air), sampling=grid.spacing_m)
    )
    to_face_m = np.maximum(to_centre_m - 0.5 * min(grid.spacing_m), 0.0)
    return jnp.minimum(distance, jnp.asarray(to_face_m, jnp.float32))


def _even_walls(grid: RoomGrid) -> tuple[tuple[Plane, Plane], ...]:
    return tuple((jnp.ones(grid.plane(a)), jnp.ones(grid.plane(a))) for a in AXES)


def same_on_walls(cells_m2_s: Cells) -> Viscosity:
    """The viscosity of the cells, and on the walls that of the cells beside them."""
    walls = tuple((first_plane(cells_m2_s, a), last_plane(cells_m2_s, a)) for a in AXES)
    return Viscosity(cells_m2_s, walls)
