"""What a scene says, read in one place: walls, patches, the air that leaves, and how much is known.

Statements that contradict one another are refused here, each with one sentence.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.interpolate import RegularGridInterpolator

from core.geometry import WALLS, WallName, face_of
from core.problem import PlaneData, Problem
from core.scene import Driving, Heater, Inlet, OnPatch, Outlet, Patch, Scene, Wall
from core.setting import SettingError

# As `airlens simulate --information` names them; `images`: not even a plane.
Level = Literal["surveyed", "operator", "paper", "images"]


def stated_walls(scene: Scene) -> dict[WallName, Wall | None]:
    """The scene's walls by name; None where nothing is stated. Raises SettingError for a wall stated twice."""
    walls: dict[WallName, Wall | None] = dict.fromkeys(WALLS)
    for part in scene.boundary:
        if isinstance(part, Wall):
            if walls[part.wall] is not None:
                times = sum(isinstance(p, Wall) and p.wall == part.wall for p in scene.boundary)
                raise SettingError(f"The wall {part.wall} is described {times} times; describe it once.")
            walls[part.wall] = part
    return walls


def unknown_walls(scene: Scene) -> list[WallName]:
    """Walls of which nobody stated what heat passes them."""
    walls = stated_walls(scene)
    return [name for name, wall in walls.items() if wall is None or wall.thermal == "unknown"]


def passes_no_heat(scene: Scene, wall: WallName) -> bool:
    """Whether the wall is stated to be adiabatic: a plane on it shows the air, on any other wall that wall."""
    stated = stated_walls(scene)[wall]
    return stated is not None and stated.thermal == "adiabatic"


def level_of(problem: Problem) -> Level:
    """How much is known: what drives the air and all walls, what drives the air, a plane, or images alone."""
    if any(isinstance(part, Driving) for part in problem.scene.boundary):
        return "operator" if unknown_walls(problem.scene) else "surveyed"
    return "paper" if problem.planes else "images"


def measured_outlets(scene: Scene) -> list[tuple[int, Outlet, float]]:
    """Outlets whose mean temperature is measured: place among the scene's outlets, outlet, and kelvin."""
    outlets = [part for part in scene.boundary if isinstance(part, Outlet)]
    return [
        (n, outlet, outlet.mean_temperature_k)
        for n, outlet in enumerate(outlets)
        if outlet.mean_temperature_k is not None
    ]


def supplied_m3_s(scene: Scene) -> float:
    """Volume flow of all supplies, as stated."""
    inlets = [part for part in scene.boundary if isinstance(part, Inlet)]
    return float(sum(inlet.inward_m_s * inlet.patch.area_m2 for inlet in inlets))


def outlet_shares(scene: Scene) -> Float[np.ndarray, " outlets"]:
    """Of the air that leaves, what leaves by each outlet: by the flows that are stated, what remains by area.

    Where every outlet's flow is stated their ratios are kept, whatever the supplies bring.

    Raises:
        SettingError: stated flows leave nothing to the outlets without one.
    """
    outlets = [part for part in scene.boundary if isinstance(part, Outlet)]
    areas_m2 = np.array([outlet.patch.area_m2 for outlet in outlets])
    flows_m3_s = np.array([outlet.flow_m3_s or 0.0 for outlet in outlets])
    free = flows_m3_s == 0.0
    if free.all():
        return areas_m2 / max(float(areas_m2.sum()), 1e-12)
    if free.any():
        supplied, stated = supplied_m3_s(scene), float(flows_m3_s.sum())
        if stated >= supplied:
            raise SettingError(
                f"The outlets' stated flows are {3600 * stated:.4g} m3/h in all and the supplies bring "
                f"{3600 * supplied:.4g} m3/h, so nothing is left for an outlet without a flow. Correct the flows, "
                "or state that of every outlet."
            )
        flows_m3_s = np.where(free, (supplied - stated) * areas_m2 / areas_m2[free].sum(), flows_m3_s)
    return flows_m3_s / flows_m3_s.sum()


def leaving_excess_k(problem: Problem) -> float | None:
    """Mean temperature of the air that leaves, in excess of ambient; None where nothing tells it.

    By the outlets' thermometers, each weighted with what leaves there; else by a plane's outflow.
    """
    ambient_k = problem.scene.air.ambient_temperature_k
    measured = measured_outlets(problem.scene)
    if measured:
        shares = outlet_shares(problem.scene)[[n for n, *_ in measured]]
        return float(np.dot(shares / shares.sum(), [kelvin - ambient_k for *_, kelvin in measured]))
    for plane in problem.planes:
        face = face_of(plane.wall)
        leaving = np.maximum(-face.inward * plane.velocity_m_s[..., face.axis], 0.0)
        if leaving.sum() > 0:
            return float((leaving * (plane.temperature_k - ambient_k)).sum() / leaving.sum())
    return None


def share_area(one: Patch, other: Patch) -> bool:
    """Whether two patches lie over one another."""
    shared = [
        min(h1, h2) - max(l1, l2)
        for l1, h1, l2, h2 in zip(one.lower_m, one.upper_m, other.lower_m, other.upper_m, strict=True)
    ]
    return one.wall == other.wall and min(shared) > 1e-9


def refuse_overlaps(parts: Sequence[OnPatch]) -> None:
    """Raise SettingError if two of these share area on a wall."""
    for one, other in combinations(parts, 2):
        if share_area(one.patch, other.patch):
            raise SettingError(
                f"The {one.kind} and the {other.kind} on {one.patch.wall} overlap ({one.patch.lower_m} to "
                f"{one.patch.upper_m} m and {other.patch.lower_m} to {other.patch.upper_m} m): they contradict "
                "each other. Move one: a place on a wall is an inlet, an outlet or a heater."
            )


def refuse_outward(inlet: Inlet) -> None:
    """Raise SettingError if the supply does not point into the room."""
    face = face_of(inlet.patch.wall)
    if inlet.inward_m_s <= 0:
        velocity = ", ".join(f"{part + 0.0:.3g}" for part in inlet.velocity_m_s)
        raise SettingError(
            f"The inlet on {inlet.patch.wall} supplies air at ({velocity}) m/s, which does not "
            f"enter the room. Give a velocity with {'xyz'[face.axis]} {'> 0' if face.inward > 0 else '< 0'}, "
            "or make the patch an outlet."
        )


def refuse_contradicted(part: Inlet | Heater, plane: PlaneData, ambient_k: float) -> None:
    """Raise SettingError if a plane measured another temperature in the middle half of the patch.

    The plane's edges are smeared, and an entry may be wrong: a quarter of its contrast and 1 K are let pass.
    """
    if part.patch.wall != plane.wall:
        return
    axes_m = (plane.first_m, plane.second_m)
    places_m = [
        np.clip(np.linspace(low + 0.25 * (high - low), high - 0.25 * (high - low), 5), axis_m[0], axis_m[-1])
        for axis_m, low, high in zip(axes_m, part.patch.lower_m, part.patch.upper_m, strict=True)
    ]
    found_k = RegularGridInterpolator(axes_m, plane.temperature_k)(
        np.stack(np.meshgrid(*places_m, indexing="ij"), -1)
    )
    measured_k = float(np.median(found_k))
    if abs(measured_k - part.temperature_k) > 1.0 + 0.25 * abs(part.temperature_k - ambient_k):
        raise SettingError(
            f"The {part.kind} on {plane.wall} is stated at {part.temperature_k:g} K, and the plane {plane.wall} "
            f"has {measured_k:g} K in it: they contradict each other. Correct the one that is wrong, or leave "
            "it out."
        )
