"""Inlets and outlets that nobody stated, found in a plane of known velocity on a wall.

The vertices smear an opening's edges over one spacing. Its patch is the rectangle around the vertices with more
than half of the fastest flow through it, with the edges where the flow falls to half. The volume flow through the
patch is that of the plane.
"""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from core.geometry import Vector2, face_of
from core.known import share_area, stated_walls
from core.problem import PlaneData, Problem
from core.scene import Heater, Inlet, Outlet, Patch

# Flow below this share of the plane's fastest is taken for rounding, not for an opening.
_SLOWEST = 0.05
# Vertices with less than this share of the plane's fastest air lie on wall.
_STILL = 0.02


def with_plane_openings(problem: Problem) -> Problem:
    """The problem with the openings of its planes added, if the scene states no inlet, outlet or heater."""
    if any(isinstance(b, Inlet | Outlet | Heater) for b in problem.scene.boundary):
        return problem
    found = tuple(opening for plane in problem.planes for opening in plane_openings(plane))
    if any(share_area(one.patch, other.patch) for one, other in combinations(found, 2)):
        return problem
    kinds = {type(opening) for opening in found}
    if kinds != {Inlet, Outlet}:
        return problem
    scene = replace(problem.scene, boundary=(*problem.scene.boundary, *found))
    return Problem(scene, problem.shifts, problem.planes, problem.sensors, problem.images)


def plane_openings(plane: PlaneData) -> list[Inlet | Outlet]:
    """Inlets and outlets of one plane, with their flow-weighted mean temperature and velocity."""
    face = face_of(plane.wall)
    inward = plane.velocity_m_s[..., face.axis] * face.inward
    found: list[Inlet | Outlet] = []
    fastest = float(np.abs(inward).max())
    for sign in (1.0, -1.0):
        through = np.maximum(sign * inward, 0.0)
        regions, count = ndimage.label(through > _SLOWEST * fastest)  # type: ignore[misc]
        for n in range(count):
            own = np.where(regions == n + 1, through, 0.0)
            if fastest > 0 and min(np.ptp(np.nonzero(own)[0]), np.ptp(np.nonzero(own)[1])) > 0:
                found.append(_opening(plane, own, supplies=sign > 0))
    return found


def air_planes(problem: Problem) -> list[PlaneData]:
    """Planes on walls whose temperature is not stated. A plane on another wall shows what was stated, and no air."""
    walls = stated_walls(problem.scene)
    held = {name for name, wall in walls.items() if wall is not None and wall.thermal == "temperature"}
    return [plane for plane in problem.planes if plane.wall not in held]


def profiles(problem: Problem) -> list[PlaneData]:
    """Planes that show the air at every height."""
    return [plane for plane in air_planes(problem) if face_of(plane.wall).axis != 2]


def still_vertices(plane: PlaneData) -> Bool[np.ndarray, "first second"]:
    """Inner vertices of the plane that lie on wall, not in an opening; all inner ones if there are none such."""
    inner = np.zeros(plane.temperature_k.shape, bool)
    inner[1:-1, 1:-1] = True
    speed = np.abs(plane.velocity_m_s).max(axis=2)
    still = inner & (speed <= _STILL * speed.max())
    return still if still.any() else inner


def _opening(
    plane: PlaneData, through_m_s: Float[np.ndarray, "first second"], *, supplies: bool
) -> Inlet | Outlet:
    """The opening with the flow `through_m_s`."""
    core = through_m_s > 0.5 * through_m_s.max()
    (f0, f1), (s0, s1) = (
        _extent(axis_m, through_m_s.max(axis=1 - n), core.any(axis=1 - n))
        for n, axis_m in enumerate((plane.first_m, plane.second_m))
    )
    lower: Vector2 = (f0, s0)
    upper: Vector2 = (f1, s1)
    patch = Patch(wall=plane.wall, lower_m=lower, upper_m=upper)  # type: ignore[arg-type]
    area = np.outer(_widths(plane.first_m), _widths(plane.second_m))
    flow = through_m_s * area
    weight = np.where(core, flow, 0.0)
    temperature_k = float((weight * plane.temperature_k).sum() / weight.sum())
    if not supplies:
        return Outlet(patch=patch, mean_temperature_k=temperature_k)
    direction = (weight[..., None] * plane.velocity_m_s).sum((0, 1)) / (weight * through_m_s).sum()
    x, y, z = (float(v) for v in direction * flow.sum() / ((f1 - f0) * (s1 - s0)))
    return Inlet(patch=patch, temperature_k=temperature_k, velocity_m_s=(x, y, z))


def _extent(
    axis_m: Float[np.ndarray, " n"], profile: Float[np.ndarray, " n"], core: Bool[np.ndarray, " n"]
) -> tuple[float, float]:
    """Where the profile crosses half its height on both sides of `core`, or the axis ends."""
    level = 0.5 * float(profile.max())
    inside = np.flatnonzero(core)
    low, high = float(axis_m[inside[0]]), float(axis_m[inside[-1]])
    if inside[0] > 0:
        low = _crossing(axis_m, profile, int(inside[0]) - 1, level)
    if inside[-1] < len(axis_m) - 1:
        high = _crossing(axis_m, profile, int(inside[-1]), level)
    return low, high


def _crossing(
    axis_m: Float[np.ndarray, " n"], profile: Float[np.ndarray, " n"], left: int, level: float
) -> float:
    """Where the line from vertex `left` to the next passes `level`."""
    before, after = float(profile[left]), float(profile[left + 1])
    share = float(np.clip((level - before) / (after - before), 0.0, 1.0)) if after != before else 0.5
    return float(axis_m[left] + share * (axis_m[left + 1] - axis_m[left]))


def _widths(axis_m: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Trapezoidal weights."""
    steps = np.array([b - a for a, b in pairwise(axis_m)])
    return 0.5 * (np.concatenate([steps[:1] * 0, steps]) + np.concatenate([steps, steps[:1] * 0]))
