"""From a scene to the room solver: patches on cell faces, and the parameters that a fit may change.

`RoomLayout` holds where things are, `RoomParameters` the numbers that may be wrong; `boundary` makes the walls'
arrays from both. Refused here: supply air without an outlet, patches that leave their wall or overlap, a wall
described twice, a supply that points out of the room. A patch smaller than a cell is kept, with a sentence.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.air import Air
from core.geometry import WALLS, WallName, face_of
from core.known import outlet_shares, refuse_outward, refuse_overlaps, stated_walls, supplied_m3_s
from core.objects import RoomObject
from core.room.openings import Opening, lay_patch, supply_turbulence
from core.room.room_grid import AXES, RoomGrid
from core.room.solids import Solids, SurfaceHeat, lay_objects
from core.room.vertices import linear_matrix
from core.room.wall_planes import Boundary, WallPlane, closed_wall
from core.scene import Heater, Inlet, OnPatch, Outlet, Scene, Wall
from core.setting import SettingError, setting
from core.significance import EITHER_WAY
from core.view_frame import passed_walls


class SuspectedHeater(Heater):
    """A heater that nobody stated: its heat is fitted. Its temperature alone has no meaning and is not shown."""


@setting
class MeasuredWall(Wall):
    """A wall whose temperature a plane shows from place to place; `temperature_k` is the mean.

    Places are rows along the first of the wall's axes (in the order x, y, z) and columns along the second.
    """

    first_m: tuple[float, ...]
    second_m: tuple[float, ...]
    place_k: tuple[tuple[float, ...], ...]


class RoomParameters(eqx.Module):
    """The numbers that may be wrong. Temperatures are in excess of ambient; logarithms are natural.

    `inlet_log_flow` is a factor on the stated velocity. `wall_log_heat` and `heater_log_heat` are heat coefficients
    [m/s]; `log_heat` is a factor on those of all walls. `log_closure` is a factor on the eddy viscosity, and
    `log_viscosity` one that varies over the room on a coarse lattice. An object of stated power has `object_power_w`;
    one of stated temperature `object_excess_k` and the heat coefficient `object_log_heat` [m/s].
    """

    inlet_excess_k: Float[Array, " inlets"]
    inlet_log_flow: Float[Array, " inlets"]
    log_heat: Float[Array, ""]
    wall_excess_k: Float[Array, "6"]
    wall_log_heat: Float[Array, "6"]
    heater_excess_k: Float[Array, " heaters"]
    heater_log_heat: Float[Array, " heaters"]
    log_closure: Float[Array, ""]
    log_viscosity: Float[Array, "3 3 4"]
    object_power_w: Float[Array, " objects"] = eqx.field(default_factory=lambda: jnp.zeros(0))
    object_excess_k: Float[Array, " objects"] = eqx.field(default_factory=lambda: jnp.zeros(0))
    object_log_heat: Float[Array, " objects"] = eqx.field(default_factory=lambda: jnp.zeros(0))


class RoomLayout(eqx.Module):
    """Where openings and heaters are, what is stated about them, and sentences on what the grid cannot hold.

    `outlet_shares`: of the air that leaves, the share that leaves by each outlet. `shown`: whether vertices on a
    heater get its temperature. `heated`, `no_slip`, `held`: of each wall, 1 if heat passes it, if air sticks to it,
    and if its temperature is stated. `own`: 1 if its vertices show its own temperature and not the air's: a stated
    one, and a fitted one where a camera looks through the wall or at it. `apart_k`: how far each face of each wall is
    from the wall's temperature.
    `solids` are the objects in the room, and `objects` those of the scene; None and empty where there are none.
    """

    grid: RoomGrid
    inlets: tuple[Opening, ...]
    inlet_velocity_m_s: Float[np.ndarray, "inlets 3"]
    inlet_k_epsilon: Float[np.ndarray, "inlets 2"]
    outlets: tuple[Opening, ...]
    outlet_shares: Float[np.ndarray, " outlets"]
    heaters: tuple[Opening, ...]
    shown: tuple[bool, ...] = eqx.field(static=True)
    heated: Float[np.ndarray, "6"]
    no_slip: Float[np.ndarray, "6"]
    held: Float[np.ndarray, "6"]
    own: Float[np.ndarray, "6"]
    apart_k: tuple[Float[np.ndarray, "_ _"], ...]
    notes: tuple[str, ...] = eqx.field(static=True)
    objects: tuple[RoomObject, ...] = eqx.field(static=True, default=())
    solids: Solids | None = None
    heat_capacity_j_m3_k: float = eqx.field(static=True, default=Air().heat_capacity_j_m3_k)

    def inflow_m3_s(self, parameters: RoomParameters) -> Float[Array, " inlets"]:
        """Volume flow of every inlet."""
        normal = np.array(
            [o.inward * v[o.axis] for o, v in zip(self.inlets, self.inlet_velocity_m_s, strict=True)]
        )
        area = np.array([o.area_m2 for o in self.inlets])
        return jnp.asarray(normal * area, jnp.float32) * jnp.exp(parameters.inlet_log_flow)


def room_layout(scene: Scene, grid: RoomGrid) -> RoomLayout:
    """Lay the scene's boundary on `grid`.

    Raises:
        SettingError: flow that cannot leave, patches off a wall or overlapping, contradictory walls.
    """
    inlets = [b for b in scene.boundary if isinstance(b, Inlet)]
    outlets = [b for b in scene.boundary if isinstance(b, Outlet)]
    heaters = [b for b in scene.boundary if isinstance(b, Heater)]
    walls = stated_walls(scene)
    if inlets and not outlets:
        flow = ", ".join(f"{i.velocity_m_s}" for i in inlets)
        raise SettingError(
            f"Air flows in at {flow} m/s but no outlet is named, so it cannot leave. "
            "Add [[scene.boundary]] with kind = 'outlet' and its patch."
        )
    refuse_overlaps([b for b in scene.boundary if isinstance(b, OnPatch)])
    for inlet in inlets:
        refuse_outward(inlet)
    notes = _unlike_flows(scene)
    place = [
        [lay_patch(b.patch, scene.room, grid, notes) for b in kind] for kind in (inlets, outlets, heaters)
    ]
    notes += _shared_cells(place[0], place[1])
    solids = lay_objects(scene.objects, grid, notes)
    for kind, opening in (*(("inlet", o) for o in place[0]), *(("outlet", o) for o in place[1])):
        _refuse_covered(kind, opening, solids, grid)
    stated = [walls[name] for name in WALLS]
    heated = np.array([float(wall is None or wall.thermal != "adiabatic") for wall in stated])
    no_slip = np.array([float(wall is None or wall.no_slip) for wall in stated])
    held = np.array([float(wall is not None and wall.thermal == "temperature") for wall in stated])
    return RoomLayout(
        grid,
        tuple(place[0]),
        np.array([i.velocity_m_s for i in inlets], float).reshape(-1, 3),
        np.array([supply_turbulence(i) for i in inlets], float).reshape(-1, 2),
        tuple(place[1]),
        outlet_shares(scene),
        tuple(place[2]),
        tuple(not isinstance(heater, SuspectedHeater) for heater in heaters),
        heated,
        no_slip,
        held,
        np.maximum(held, heated * _in_sight(scene)),
        tuple(_apart_k(wall, name, grid) for name, wall in walls.items()),
        tuple(notes),
        scene.objects,
        solids,
        scene.air.heat_capacity_j_m3_k,
    )


def _in_sight(scene: Scene) -> Float[np.ndarray, "6"]:
    """Of each wall, 1 where a camera looks through it or at it: there the layer of its air bends every ray.

    Beside the others the pictures are left out (`core.data_error.WALL_MARGIN`), so nothing tells such a temperature.
    """
    passed = [passed_walls(view, scene.room) for view in scene.views]
    return np.array([float(any(name in walls for walls in passed)) for name in WALLS])


def _apart_k(wall: Wall | None, name: WallName, grid: RoomGrid) -> Float[np.ndarray, "first second"]:
    """How far the faces of a wall are from its temperature: zero, but where a plane shows more."""
    if not isinstance(wall, MeasuredWall):
        return np.zeros(grid.plane(face_of(name).axis), np.float32)
    first, second = face_of(name).along
    rows, columns = (
        linear_matrix(np.asarray(at_m), grid.centres_m(axis))
        for axis, at_m in ((first, wall.first_m), (second, wall.second_m))
    )
    place_k = np.asarray(wall.place_k) - wall.temperature_k
    return (rows @ place_k @ columns.T).astype(np.float32)


def boundary(layout: RoomLayout, parameters: RoomParameters) -> Boundary:
    """The walls' arrays for these parameters."""
    planes = [_bare(layout, wall, parameters) for wall in range(6)]
    inflow = layout.inflow_m3_s(parameters)
    for n, opening in enumerate(layout.inlets):
        planes[opening.wall] = _with_inlet(planes[opening.wall], layout, n, parameters)
    for opening, share in zip(layout.outlets, layout.outlet_shares, strict=True):
        speed = inflow.sum() / opening.area_m2 * float(share)
        fraction = jnp.asarray(opening.fraction, jnp.float32)
        wall = planes[opening.wall]
        planes[opening.wall] = eqx.tree_at(
            lambda w: w.normal_m_s, wall, wall.normal_m_s - opening.inward * speed * fraction
        )
    solids = _heated(layout, parameters)
    if solids is not None:
        planes = [_behind(plane, wall, solids) for wall, plane in enumerate(planes)]
    x, y, z = ((planes[2 * a], planes[2 * a + 1]) for a in AXES)
    return Boundary((x, y, z), solids)


def _heated(layout: RoomLayout, parameters: RoomParameters) -> Solids | None:
    """The objects with their heat: power spread evenly over the faces in air, or h (T_surface - T)."""
    solids = layout.solids
    if solids is None:
        return None
    area_m2 = np.bincount(solids.owner, weights=solids.area_m2, minlength=len(layout.objects))
    power = np.array([item.thermal == "power" for item in layout.objects], np.float32)
    held = np.array([item.thermal == "temperature" for item in layout.objects], np.float32)
    share = power / (layout.heat_capacity_j_m3_k * np.maximum(area_m2, 1e-9)).astype(np.float32)
    heat = SurfaceHeat(
        (parameters.object_power_w * share)[solids.owner],
        (jnp.exp(parameters.object_log_heat) * held)[solids.owner],
        parameters.object_excess_k[solids.owner],
    )
    return eqx.tree_at(lambda s: s.heat, solids, heat)


def _behind(plane: WallPlane, wall: int, solids: Solids) -> WallPlane:
    """The wall without heat where an object stands against it."""
    face = face_of(WALLS[wall])
    air = jnp.take(solids.air, jnp.array(face.end), axis=face.axis)
    return eqx.tree_at(lambda w: w.conductance_m_s, plane, plane.conductance_m_s * air)


def _refuse_covered(kind: str, opening: Opening, solids: Solids | None, grid: RoomGrid) -> None:
    if solids is None:
        return
    face = face_of(WALLS[opening.wall])
    solid = np.take(np.asarray(solids.air), face.end, axis=face.axis) == 0
    if (solid & (opening.fraction > 0)).any():
        raise SettingError(
            f"An object covers cells of the {kind} on {WALLS[opening.wall]}, on the grid of "
            f"{' x '.join(map(str, grid.cells))} cells. Move it a little farther from the opening."
        )


def _shared_cells(inlets: list[Opening], outlets: list[Opening]) -> list[str]:
    """A sentence for each supply that shares a cell's face with an outlet: in a face only their difference flows."""
    shared = [i.wall for i in inlets for o in outlets if i.wall == o.wall and (i.fraction * o.fraction).any()]
    return [
        f"A supply and an outlet on {WALLS[wall]} share a cell: a part of the supply's air leaves where it comes in. "
        "Use a finer grid."
        for wall in shared
    ]


def _unlike_flows(scene: Scene) -> list[str]:
    """A sentence where all outlets' flows are stated, and are not what the supplies bring within their deviations."""
    flows_m3_s = [part.flow_m3_s for part in scene.boundary if isinstance(part, Outlet)]
    leaving = [flow for flow in flows_m3_s if flow is not None]
    inlets = [part for part in scene.boundary if isinstance(part, Inlet)]
    supplied_std = float(np.linalg.norm([i.velocity_std_m_s * i.patch.area_m2 for i in inlets]))
    supplied = supplied_m3_s(scene)
    if not leaving or len(leaving) < len(flows_m3_s):
        return []
    if abs(sum(leaving) - supplied) <= EITHER_WAY * supplied_std:
        return []
    return [
        f"The outlets' flows are {3600 * sum(leaving):.4g} m3/h in all, but the supplies bring {3600 * supplied:.4g} "
        "m3/h, and their deviations do not hold the difference. The supplies' flow was taken, shared as the outlets' "
        "flows are. Check them."
    ]


def _bare(layout: RoomLayout, wall: int, parameters: RoomParameters) -> WallPlane:
    """The wall and its heaters, without flow: conductances are added, weighted by area."""
    grid = layout.grid
    plane = closed_wall(grid, wall // 2, float(layout.no_slip[wall]))
    closed = jnp.ones_like(plane.normal_m_s)
    for opening in (*layout.inlets, *layout.outlets, *layout.heaters):
        if opening.wall == wall:
            closed = closed - jnp.asarray(opening.fraction, jnp.float32)
    conductance = (
        float(layout.heated[wall]) * closed * jnp.exp(parameters.log_heat + parameters.wall_log_heat[wall])
    )
    heat = conductance * (parameters.wall_excess_k[wall] + layout.apart_k[wall])
    held = jnp.full_like(conductance, layout.own[wall])
    for n, opening in enumerate(layout.heaters):
        if opening.wall == wall:
            fraction = jnp.asarray(opening.fraction, jnp.float32)
            own = fraction * jnp.exp(parameters.heater_log_heat[n])
            conductance, heat = conductance + own, heat + own * parameters.heater_excess_k[n]
            held = jnp.maximum(held, fraction) if layout.shown[n] else jnp.where(fraction > 0, 0.0, held)
    return eqx.tree_at(
        lambda w: (w.conductance_m_s, w.wall_excess_k, w.held),
        plane,
        (conductance, heat / (conductance + 1e-12), held),
    )


def _with_inlet(plane: WallPlane, layout: RoomLayout, n: int, parameters: RoomParameters) -> WallPlane:
    """The wall with supply `n`: flow, temperature, turbulence, and the momentum that partly covered faces lose."""
    opening = layout.inlets[n]
    fraction = jnp.asarray(opening.fraction, jnp.float32)
    velocity = jnp.asarray(layout.inlet_velocity_m_s[n], jnp.float32) * jnp.exp(parameters.inlet_log_flow[n])
    inside = fraction > 0
    first, second = (a for a in AXES if a != opening.axis)
    normal = velocity[opening.axis]
    flow_m_s = plane.normal_m_s + normal * fraction
    # A face that is covered in part, or by several supplies, has their mean speed, which carries less momentum.
    missing = normal**2 * fraction - (flow_m_s**2 - plane.normal_m_s**2)
    # Where two supplies share a face, what they bring is mixed as they flow.
    share = jnp.where(inside, normal * fraction / jnp.where(flow_m_s == 0.0, 1.0, flow_m_s), 0.0)
    # Speed scales k by its square and epsilon by its cube.
    gain = jnp.exp(parameters.inlet_log_flow[n])
    k, epsilon = (float(value) for value in layout.inlet_k_epsilon[n])

    def put(old: Float[Array, "..."], new: Float[Array, ""]) -> Float[Array, "..."]:
        return (1.0 - share) * old + share * new

    return WallPlane(
        flow_m_s,
        (put(plane.tangent_m_s[0], velocity[first]), put(plane.tangent_m_s[1], velocity[second])),
        put(plane.inflow_excess_k, parameters.inlet_excess_k[n]),
        plane.force_m_s2 + opening.inward * missing / layout.grid.spacing_m[opening.axis],
        plane.conductance_m_s,
        plane.wall_excess_k,
        put(plane.turbulent_energy_m2_s2, k * gain**2),
        put(plane.dissipation_m2_s3, epsilon * gain**3),
        plane.no_slip,
        plane.held,
    )
