"""What a plane on a wall shows that nobody stated: inlets and outlets, and the wall's temperature.

The vertices smear an opening's edges over one spacing. Its patch is the rectangle around the vertices with more
than half of the fastest flow through it, with the edges where the flow falls to half. The volume flow through the
patch is that of the plane.
"""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from core.data_error import PLANE_NOISE_K
from core.geometry import Vector2, face_of
from core.known import measured_outlets, passes_no_heat, share_area, stated_walls, unknown_walls
from core.problem import PlaneData, Problem
from core.room.boundary_conditions import MeasuredWall
from core.scene import BoundaryInformation, Driving, Heater, Inlet, Outlet, Patch, Wall
from core.setting import SettingError

# Flow below this share of the plane's fastest is taken for rounding, not for an opening.
_SLOWEST = 0.05
# Enter and leave by a plane may differ by so much of the larger flow: vertices smear openings' edges, and flows are
# measured with errors. If they differ by more, the room has other openings.
_UNBALANCED = 0.25
# Vertices with less than this share of the plane's fastest air lie on wall.
_STILL = 0.02


def with_planes_read(problem: Problem) -> Problem:
    """The problem with what its planes show and nobody stated: openings, and the temperature of walls."""
    return _with_walls(_with_openings(problem))


def _with_openings(problem: Problem) -> Problem:
    """The problem with the openings of its planes added, if the scene states no inlet, outlet or heater."""
    if any(isinstance(b, Inlet | Outlet | Heater) for b in problem.scene.boundary):
        return problem
    found = tuple(opening for plane in problem.planes for opening in plane_openings(plane))
    if any(share_area(one.patch, other.patch) for one, other in combinations(found, 2)):
        return problem
    entering, leaving = passing_m3_s(problem)
    kinds = {type(opening) for opening in found}
    if kinds != {Inlet, Outlet} or abs(entering - leaving) > _UNBALANCED * max(entering, leaving):
        return problem
    return _stating(problem, (*problem.scene.boundary, *found))


def passing_m3_s(problem: Problem) -> tuple[float, float]:
    """Volume flows that enter, and that leave, by the planes."""
    entering = leaving = 0.0
    for plane in problem.planes:
        face = face_of(plane.wall)
        inward = face.inward * plane.velocity_m_s[..., face.axis]
        entering += float((np.maximum(inward, 0.0) * _areas_m2(plane)).sum())
        leaving += float((np.maximum(-inward, 0.0) * _areas_m2(plane)).sum())
    return entering, leaving


def refuse_walls_alone(problem: Problem) -> None:
    """Raise SettingError if planes show walls, and nothing states what drives the air or how warm it is.

    The problem is one whose planes were read.
    """
    scene = problem.scene
    stated = [
        isinstance(part, Driving)
        or (isinstance(part, Wall) and not isinstance(part, MeasuredWall) and part.thermal == "temperature")
        for part in scene.boundary
    ]
    if any(stated) or not problem.planes or air_planes(problem) or problem.sensors or measured_outlets(scene):
        return
    entering, leaving = (round(3600 * flow) for flow in passing_m3_s(problem))
    raise SettingError(
        f"{entering} m3/h enter by the planes and {leaving} m3/h leave by them, so they do not show all openings of "
        "the room; and nothing else states what drives the air or how warm it is. State every inlet and outlet, or "
        "add a thermometer in the air."
    )


def _with_walls(problem: Problem) -> Problem:
    """The problem with the temperature of each wall on which a plane lies, if nobody stated what heat passes it."""
    walls, unknown = stated_walls(problem.scene), unknown_walls(problem.scene)
    shown = [_measured(plane, walls[plane.wall]) for plane in problem.planes if plane.wall in unknown]
    if not shown:
        return problem
    replaced = [walls[wall.wall] for wall in shown]
    kept = tuple(part for part in problem.scene.boundary if part not in replaced)
    return _stating(problem, (*kept, *shown))


def _stating(problem: Problem, boundary: tuple[BoundaryInformation, ...]) -> Problem:
    scene = replace(problem.scene, boundary=boundary)
    return Problem(scene, problem.shifts, problem.planes, problem.sensors, problem.images)


def _measured(plane: PlaneData, stated: Wall | None) -> MeasuredWall:
    """The wall that a plane shows; in openings, and at the rim, as the nearest wall beside them."""
    still = still_vertices(plane)
    nearest = np.asarray(ndimage.distance_transform_edt(~still, return_distances=False, return_indices=True))
    place_k = plane.temperature_k[nearest[0], nearest[1]]
    return MeasuredWall(
        wall=plane.wall,  # type: ignore[arg-type]
        no_slip=stated is None or stated.no_slip,
        thermal="temperature",
        temperature_k=float(plane.temperature_k[still].mean()),
        temperature_std_k=PLANE_NOISE_K,
        first_m=tuple(float(m) for m in plane.first_m),
        second_m=tuple(float(m) for m in plane.second_m),
        place_k=tuple(tuple(float(k) for k in row) for row in place_k),
    )


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
    """Planes on walls that pass no heat: they show the air. Any other plane shows its wall."""
    return [plane for plane in problem.planes if passes_no_heat(problem.scene, plane.wall)]  # type: ignore[arg-type]


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
    flow = through_m_s * _areas_m2(plane)
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


def _areas_m2(plane: PlaneData) -> Float[np.ndarray, "first second"]:
    """The area that each vertex stands for."""
    return np.outer(_widths(plane.first_m), _widths(plane.second_m))


def _widths(axis_m: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Trapezoidal weights."""
    steps = np.array([b - a for a, b in pairwise(axis_m)])
    return 0.5 * (np.concatenate([steps[:1] * 0, steps]) + np.concatenate([steps, steps[:1] * 0]))
