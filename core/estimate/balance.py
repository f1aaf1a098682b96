"""The heat balance of the room: supply and objects bring heat; the outlets and the walls take it away.

With a thermometer in the air that leaves, the balance gives one number that nobody can state: the heat coefficient
that all walls share or, where walls are unknown, the temperature that they share.
"""

import numpy as np
from jaxtyping import Float

from core.estimate.plane_openings import profiles, still_vertices
from core.known import leaving_excess_k
from core.problem import Problem
from core.room.boundary_conditions import RoomLayout, SuspectedHeater
from core.room.k_epsilon import NOMINAL_HEAT_M_S
from core.scene import Heater, Scene

# Heat coefficient of a heater, and of an object of stated temperature [m/s]: 3 W/m2K over rho c.
HEATER_HEAT_M_S = 2.5e-3


def free_walls_k(
    problem: Problem, layout: RoomLayout, inlet_excess_k: np.ndarray, wall_excess_k: np.ndarray
) -> tuple[float, float]:
    """The shared temperature of the unknown walls that closes the heat balance, and its distance from the air.

    Both are excess temperatures. Without a measured outflow temperature the walls get the ambient one. The
    distance is limited to the supply's excess temperature.
    """
    leaving = leaving_excess_k(problem)
    if leaving is None or not layout.inlets:
        return 0.0, 0.0
    areas = _heated_areas_m2(layout)
    free = areas * (layout.held == 0)
    if free.sum() == 0:
        return 0.0, 0.0
    inside = _room_excess_k(problem, leaving)
    brought = float(np.dot(supply_m3_s(layout), inlet_excess_k - leaving)) + objects_k_m3_s(problem.scene)
    brought += _warm_surfaces_k_m3_s(problem.scene, layout, inside)
    known = NOMINAL_HEAT_M_S * float(((areas - free) * (inside - wall_excess_k)).sum())
    apart = (brought - known) / (NOMINAL_HEAT_M_S * float(free.sum()))
    contrast = max(float(np.abs(inlet_excess_k).max()), abs(inside))
    apart = float(np.clip(apart, -contrast, contrast))
    return inside - apart, abs(apart)


def _heated_areas_m2(layout: RoomLayout) -> Float[np.ndarray, "6"]:
    """Area of each wall; 0 for an adiabatic one."""
    grid = layout.grid
    return (
        np.array([grid.face_area_m2(w // 2) * np.prod(grid.plane(w // 2)) for w in range(6)]) * layout.heated
    )


def supply_m3_s(layout: RoomLayout) -> Float[np.ndarray, " inlets"]:
    """Volume flow of each inlet, as stated."""
    return np.array(
        [
            o.inward * v[o.axis] * o.area_m2
            for o, v in zip(layout.inlets, layout.inlet_velocity_m_s, strict=True)
        ]
    )


def objects_k_m3_s(scene: Scene) -> float:
    """The stated heat of all objects, over rho c."""
    return sum((item.power_w or 0.0 for item in scene.objects), start=0.0) / scene.air.heat_capacity_j_m3_k


def _warm_surfaces_k_m3_s(scene: Scene, layout: RoomLayout, inside_k: float) -> float:
    """The heat of stated heaters and of objects of stated temperature, over rho c, by the nominal coefficient."""
    ambient_k = scene.air.ambient_temperature_k
    stated = [
        (part.temperature_k, part.patch.area_m2)
        for part in scene.boundary
        if isinstance(part, Heater) and not isinstance(part, SuspectedHeater)
    ]
    if layout.solids is not None:
        areas_m2 = np.bincount(
            layout.solids.owner, weights=layout.solids.area_m2, minlength=len(layout.objects)
        )
        held = zip(layout.objects, areas_m2, strict=True)
        stated += [
            (item.temperature_k or ambient_k, area) for item, area in held if item.thermal == "temperature"
        ]
    return HEATER_HEAT_M_S * float(sum((kelvin - ambient_k - inside_k) * area for kelvin, area in stated))


def walls_lose_k_m2(
    problem: Problem, layout: RoomLayout, inlet_excess_k: np.ndarray, wall_excess_k: np.ndarray
) -> float | None:
    """What walls of stated temperature lose for each m/s of their heat coefficient.

    None where the heat balance does not tell that coefficient.
    """
    leaving = leaving_excess_k(problem)
    areas = _heated_areas_m2(layout)
    warm = layout.heaters or any(item.thermal == "temperature" for item in layout.objects)
    if leaving is None or not layout.inlets or warm or areas.sum() == 0:
        return None
    brought = float(np.dot(supply_m3_s(layout), inlet_excess_k - leaving)) + objects_k_m3_s(problem.scene)
    inside = _room_excess_k(problem, leaving)
    lost = float((areas * (inside - wall_excess_k)).sum())
    # If heat would have to flow from cold to warm, something else is missing, and the balance tells nothing.
    return lost if brought * lost > 0 else None


def heat_balance_m_s(brought_k_m3_s: float, lost_k_m2: float) -> float:
    """The heat coefficient of all walls that closes the balance, within a factor of four of the nominal one."""
    return float(np.clip(brought_k_m3_s / lost_k_m2, NOMINAL_HEAT_M_S / 4, NOMINAL_HEAT_M_S * 4))


def _room_excess_k(problem: Problem, leaving: float) -> float:
    """Mean excess temperature of the room's air: from a plane on a side wall, else that of the outflow."""
    for plane in profiles(problem):
        return (
            float(plane.temperature_k[still_vertices(plane)].mean()) - problem.scene.air.ambient_temperature_k
        )
    return leaving
