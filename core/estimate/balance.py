"""The heat balance of the room: supply and objects bring heat; the outlets and the walls take it away.

With a thermometer in the air that leaves, the balance gives one number that nobody can state: the heat coefficient
that all walls share or, where walls are unknown, the temperature that they share.
"""

import numpy as np
from jaxtyping import Float

from core.estimate.plane_openings import profiles, still_vertices
from core.known import leaving_excess_k
from core.problem import Problem
from core.room.boundary_conditions import RoomLayout
from core.room.k_epsilon import NOMINAL_HEAT_M_S
from core.scene import Scene


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


def heat_balance_m_s(
    problem: Problem, layout: RoomLayout, inlet_excess_k: np.ndarray, wall_excess_k: np.ndarray
) -> float | None:
    """The heat coefficient of all walls that closes the balance; None where the balance cannot tell it.

    It is limited to a factor of four about the nominal one.
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
    if not brought * lost > 0:
        return None
    return float(np.clip(brought / lost, NOMINAL_HEAT_M_S / 4, NOMINAL_HEAT_M_S * 4))


def _room_excess_k(problem: Problem, leaving: float) -> float:
    """Mean excess temperature of the room's air: from a plane on a side wall, else that of the outflow."""
    for plane in profiles(problem):
        return (
            float(plane.temperature_k[still_vertices(plane)].mean()) - problem.scene.air.ambient_temperature_k
        )
    return leaving
