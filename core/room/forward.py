"""A room on one grid: from parameters to the model that is marched, and from a flow to its vertices."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.air import GRAVITY_M_S2
from core.geometry import WALLS, Face, face_of
from core.room.boundary_conditions import RoomLayout, RoomParameters, boundary, room_layout
from core.room.closure import (
    AbstractClosure,
    ConstantClosure,
    KEpsilonClosure,
    ZeroEquationClosure,
    wall_distance_m,
)
from core.room.eddies import LargeEddies
from core.room.openings import opening_edges_m
from core.room.room_grid import AXES, RoomGrid, Velocity, room_grid
from core.room.step import Flow, RoomModel, air_at_rest, room_model
from core.room.vertices import (
    RoomFields,
    interpolated,
    linear_matrix,
    vertex_excess_k,
    vertex_pressure_m2_s2,
    vertex_velocity_m_s,
)
from core.scene import Scene

# nu_t = 0.0058 U sqrt(A) is the mean of k-epsilon's over the reference rooms.
_EDDY_SHARE = 0.0058
# The closure's name of a room whose large eddies are marched.
LARGE_EDDIES = "large_eddies"


class Room(eqx.Module):
    """A scene on a grid with a closure; `speed_m_s` is the velocity scale of its flow."""

    scene: Scene = eqx.field(static=True)
    layout: RoomLayout
    closure: str = eqx.field(static=True)
    speed_m_s: float = eqx.field(static=True)

    @property
    def grid(self) -> RoomGrid:
        """The cells."""
        return self.layout.grid

    @property
    def turnover_ratio(self) -> float:
        """Turnover time L / U over that of the reference room (3.3 m, 0.5 m/s), from 1 to 4."""
        edge_m = float(np.prod(self.scene.room.size_m)) ** (1 / 3)
        return float(np.clip(edge_m / self.speed_m_s / 6.6, 1.0, 4.0))

    def model(self, parameters: RoomParameters) -> RoomModel:
        """The solver's model for these parameters."""
        air = self.scene.air
        bare = room_model(
            self.grid,
            boundary(self.layout, parameters),
            self._closure(jnp.exp(parameters.log_closure)),
            buoyancy_m_s2_k=GRAVITY_M_S2 * air.expansion_per_k,
            molecular_m2_s=air.kinematic_viscosity_m2_s,
            prandtl=air.prandtl,
        )
        return eqx.tree_at(
            lambda m: m.log_viscosity, bare, lattice_to_cells(parameters.log_viscosity, self.grid)
        )

    def at_rest(self, model: RoomModel, profile_k: Float[np.ndarray, " nz"]) -> Flow:
        """Still air whose temperature depends on height alone."""
        excess = jnp.asarray(np.broadcast_to(profile_k, self.grid.cells), jnp.float32)
        return air_at_rest(model, excess, self.speed_m_s)

    def _closure(self, scale: Float[Array, ""]) -> AbstractClosure:
        molecular = jnp.float32(self.scene.air.kinematic_viscosity_m2_s)
        flow = self.scene.flow
        if self.closure == "zero_equation":
            return ZeroEquationClosure(wall_distance_m(self.grid, self.layout.solids), scale, molecular)
        if self.closure == "constant":
            area = (
                sum(o.area_m2 for o in self.layout.inlets)
                or float(np.prod(self.scene.room.size_m)) ** (2 / 3) / 90
            )
            eddy = flow.viscosity_m2_s or _EDDY_SHARE * self.speed_m_s * area**0.5
            return ConstantClosure(scale * eddy, molecular)
        if self.closure == LARGE_EDDIES:
            return LargeEddies(molecular)
        if self.closure == "molecular":
            return ConstantClosure(0.0 * scale, molecular)
        return KEpsilonClosure(scale, molecular, self.scene.air.prandtl)


def closure_name(scene: Scene) -> str:
    """The closure that a scene states; `auto` gives k-epsilon."""
    named = {"molecular": "molecular", "given": "constant", "zero_equation": "zero_equation"}
    return named.get(scene.flow.transport, "k_epsilon")


def room(scene: Scene, cells: int, closure: str) -> Room:
    """`scene` on about cells^3 cells. Raises SettingError for a boundary that cannot be."""
    layout = room_layout(scene, room_grid(scene.room, cells, opening_edges_m(scene)))
    speeds = [float(np.linalg.norm(v)) for v in layout.inlet_velocity_m_s]
    return Room(scene, layout, closure, max([*speeds, _plume_speed_m_s(scene)]))


def _plume_speed_m_s(scene: Scene) -> float:
    """A tenth of the free-fall speed of the largest stated contrast over the room's height, or a plume's speed."""
    ambient = scene.air.ambient_temperature_k
    stated = [getattr(part, "temperature_k", None) for part in (*scene.boundary, *scene.objects)]
    contrast = max([abs(t - ambient) for t in stated if t is not None] + [0.1])
    height_m = scene.room.size_m[2]
    falling = 0.1 * float(np.sqrt(GRAVITY_M_S2 * contrast / ambient * height_m))
    heat_w = max([abs(item.power_w or 0.0) for item in scene.objects] + [0.0])
    buoyancy_m4_s3 = GRAVITY_M_S2 / ambient * heat_w / scene.air.heat_capacity_j_m3_k
    return max(falling, (buoyancy_m4_s3 / height_m) ** (1 / 3))


def lattice_to_cells(lattice: Float[Array, "lx ly lz"], grid: RoomGrid) -> Float[Array, "nx ny nz"]:
    """A coarse lattice over the room, walls included, interpolated to the cells."""
    field = lattice
    for a in AXES:
        nodes = np.linspace(0.0, 1.0, lattice.shape[a])
        points = (np.arange(grid.cells[a]) + 0.5) / grid.cells[a]
        matrix = jnp.asarray(linear_matrix(nodes, points), jnp.float32)
        field = jnp.moveaxis(jnp.tensordot(matrix, field, axes=(1, a)), 0, a)
    return field


def carried_over(flow: Flow, source: RoomGrid, target: RoomGrid) -> Flow:
    """A flow, linearly interpolated to another grid of its room; the first step removes its divergence."""

    def cells(field: Float[Array, "nx ny nz"], faces: int | None = None) -> Float[Array, "mx my mz"]:
        found = np.asarray(field)
        for a in AXES:
            old = source.faces_m(a) if a == faces else source.centres_m(a)
            new = target.faces_m(a) if a == faces else target.centres_m(a)
            matrix = linear_matrix(old, new).astype(np.float32)
            found = interpolated(matrix, found, a)
        return jnp.asarray(found)

    u, v, w = (cells(flow.velocity[a], a) for a in AXES)
    velocity: Velocity = (u, v, w)
    turbulence = flow.turbulence
    if turbulence is not None:
        turbulence = type(turbulence)(cells(turbulence.energy_m2_s2), cells(turbulence.dissipation_m2_s3))
    return Flow(velocity, cells(flow.excess_k), cells(flow.pressure_m2_s2), turbulence)


def room_fields(
    flow: Flow, model: RoomModel, layout: RoomLayout, vertices: tuple[int, int, int]
) -> RoomFields:
    """The flow on the room's vertices, and what leaves by each outlet."""
    leaving = [_outflow_excess_k(flow, model, *of) for of in _outlet_faces(layout)]
    return RoomFields(
        vertex_excess_k(flow, model, vertices),
        vertex_pressure_m2_s2(flow, model, vertices),
        vertex_velocity_m_s(flow.velocity, model, vertices),
        np.array(leaving, float),
    )


def _outlet_faces(
    layout: RoomLayout,
) -> list[tuple[Face, Float[np.ndarray, "first second"], Float[np.ndarray, "first second"]]]:
    """Each outlet's face, its part of what leaves through every cell there, and the share that it covers."""
    found = []
    for outlet in layout.outlets:
        # Two outlets may share a cell's face: each has its part of what leaves there.
        covered = np.sum([o.fraction for o in layout.outlets if o.wall == outlet.wall], axis=0)
        part = outlet.fraction / np.where(covered > 0, covered, 1.0)
        found.append((face_of(WALLS[outlet.wall]), part, outlet.fraction))
    return found


def _outflow_excess_k(
    flow: Flow,
    model: RoomModel,
    face: Face,
    part: Float[np.ndarray, "first second"],
    area: Float[np.ndarray, "first second"],
) -> float:
    """Flow-weighted mean of the air beside an outlet; by area where no air leaves."""
    wall = model.boundary.walls[face.axis][face.upper]
    leaving = part * np.maximum(-face.inward * np.asarray(wall.normal_m_s), 0.0)
    beside = np.asarray(flow.excess_k).take(face.end, face.axis)
    weight = leaving if leaving.sum() > 0 else area
    return float((weight * beside).sum() / weight.sum())
