"""Heat that nobody stated: a warm strip of the floor, where the images ask for one.

Where walls are unknown, so is whether a heater stands on one. A room that no wall's temperature and no supply brings
near the images is marched with a panel on one strip of floor after the other, below the middle of the view, then
half-way to the neighbours of the best, each warmer until the images like it no better: where the air rises they
show, how deep in the room they do not. Air above a heater is another flow than without, so marches are compared and
no derivatives. The best strip is given to the fit as a heater whose heat is half known, between two neighbours that
may share it.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import equinox as eqx
import numpy as np

from core.estimate.forward_runs import Event, RoomSettings, march_under
from core.estimate.observation import Observations
from core.estimate.parameter_fit import Background
from core.estimate.parameter_step import misfit_ratio
from core.estimate.prior import room_prior
from core.known import leaving_excess_k, share_area
from core.problem import Problem
from core.room.boundary_conditions import RoomParameters, SuspectedHeater
from core.room.forward import Room, room
from core.scene import Heater, Inlet, Outlet, Patch

_STRIPS, _DEPTH_SHARE = 5, 0.2
# At a heater's coefficient 20 K are some 60 W/m2, over about half a square metre: from a lamp to a radiator.
_LADDER_K = (15.0, 30.0, 60.0, 120.0)
_STD_SHARE = 0.5
# A strip is tried by a fit where it alone leaves less than this of the misfit of the room without it.
_WORTHWHILE = 0.8


def with_suspected_heat(
    background: Background, data: Observations, settings: RoomSettings, report: Event
) -> Problem | None:
    """The problem with the strip of floor whose heat the images like best, and its neighbours; None for no strip."""
    strips = floor_strips(background.problem)
    climbs = climbed_each(strips, background, data, settings)
    if min((climb.left for climb in climbs), default=1.0) > _WORTHWHILE:
        return None
    best = min(climbs, key=lambda climb: climb.left)
    # A panel may lie half on one strip and half on the next.
    between = floor_strips(background.problem, between=True)
    halves = [strip for strip in between if share_area(strip.patch, best.strip.patch)]
    best = min((best, *climbed_each(halves, background, data, settings)), key=lambda climb: climb.left)
    report({"suspected_k": best.heat_k, "misfit_left": best.left})
    warm = replace(best.strip, temperature_k=best.strip.temperature_k + best.heat_k)
    beside = [strip for strip in (*strips, *between) if adjoin(strip, warm)]
    return with_heaters(
        background.problem, [replace(s, temperature_std_k=_STD_SHARE * best.heat_k) for s in (warm, *beside)]
    )


class Climb(NamedTuple):
    """By how many kelvin a strip was warm where it left least of the misfit of the room without, and how much."""

    left: float
    heat_k: float
    strip: SuspectedHeater


def climbed_each(
    strips: Sequence[SuspectedHeater], background: Background, data: Observations, settings: RoomSettings
) -> list[Climb]:
    """Every strip by itself."""
    cold = with_heaters(background.problem, strips)
    coarse = room(cold.scene, settings.coarse_cells, background.coarse.closure)
    mean = room_prior(cold, coarse.layout).mean
    before = len(mean.heater_excess_k) - len(strips)

    def climb(n: int) -> Climb:
        return Climb(*climbed(before + n, coarse, mean, background, data, settings), strips[n])

    with ThreadPoolExecutor(settings.threads) as pool:
        return list(pool.map(climb, range(len(strips))))


def climbed(
    heater: int,
    coarse: Room,
    mean: RoomParameters,
    background: Background,
    data: Observations,
    settings: RoomSettings,
) -> tuple[float, float]:
    """Least misfit with this heater warm, over that of the room without, and by how many kelvin it was warm."""
    least, best_k, flow = np.inf, 0.0, background.base.flow.last
    for heat_k in _LADDER_K:
        warm = eqx.tree_at(lambda p: p.heater_excess_k, mean, mean.heater_excess_k.at[heater].add(heat_k))
        tried = march_under(coarse, warm, flow, settings.restart_s, data.vertices, lambda _: None)
        left = misfit_ratio(data, tried, background.base)
        if left > least:
            break
        least, best_k, flow = left, heat_k, tried.flow.last
    return least, best_k


def floor_strips(problem: Problem, *, between: bool = False) -> list[SuspectedHeater]:
    """Strips of floor as warm as the air, wherever no other patch lies; or those half-way `between` these."""
    box, scene = problem.scene.room, problem.scene
    edges_m = np.linspace(box.lower_m[0], box.upper_m[0], _STRIPS + 1)
    edges_m = 0.5 * (edges_m[:-1] + edges_m[1:]) if between else edges_m
    middle_m, half_m = box.centre_m[1], 0.5 * _DEPTH_SHARE * box.size_m[1]
    air_k = scene.air.ambient_temperature_k + (leaving_excess_k(problem) or 0.0)
    taken = [b.patch for b in scene.boundary if isinstance(b, Inlet | Outlet | Heater)]
    strips = []
    for low_m, high_m in pairwise(edges_m):
        lower, upper = (float(low_m), middle_m - half_m), (float(high_m), middle_m + half_m)
        patch = Patch(wall="z_min", lower_m=lower, upper_m=upper)
        if not any(share_area(patch, other) for other in taken):
            strips.append(SuspectedHeater(patch=patch, temperature_k=air_k))
    return strips


def adjoin(one: Heater, other: Heater) -> bool:
    """Whether two strips lie side by side."""
    ends = (one.patch.lower_m[0], one.patch.upper_m[0]), (other.patch.lower_m[0], other.patch.upper_m[0])
    return ends[0][1] == ends[1][0] or ends[1][1] == ends[0][0]


def with_heaters(problem: Problem, heaters: Sequence[Heater]) -> Problem:
    """The problem with these heaters beside what is stated."""
    boundary = (*problem.scene.boundary, *heaters)
    return Problem(replace(problem.scene, boundary=boundary), problem.shifts, problem.planes, problem.sensors)
