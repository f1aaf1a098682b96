"""A heat source that nobody stated: find the strip of floor that explains the images best.

The coarse room is marched with a heated panel on each of five strips of floor in turn, and then on the two strips
half-way to the neighbours of the best one. Each panel is made warmer as long as the misfit falls. Forward runs are
compared, not derivatives, since a plume is far from linear in its heat. One view shows where along x the air rises
but not how deep in the room, so the strips lie in the middle of the room's depth. The best strip enters the fit as
a heater with a prior deviation of half its heat, and so do its neighbours on both sides.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import equinox as eqx
import numpy as np

from core.estimate.forward_runs import RoomSettings, march_under
from core.estimate.marches import Marches
from core.estimate.observation import Observations
from core.estimate.parameter_fit import Background
from core.estimate.parameter_step import misfit_ratio
from core.estimate.prior import room_prior
from core.known import leaving_excess_k, share_area
from core.problem import Problem
from core.room.boundary_conditions import RoomParameters, SuspectedHeater
from core.room.forward import Room, room
from core.scene import Heater, OnPatch, Patch

# Strips along x, and their depth along y as a share of the room's.
_STRIPS, _DEPTH_SHARE = 5, 0.2
# Temperatures above the air that are tried. At a heater's usual coefficient 20 K give some 60 W/m2 over about half a
# square metre: the range is from a lamp to a radiator.
_LADDER_K = (15.0, 30.0, 60.0, 120.0)
# Prior deviation of the found heat, as a share of it.
_STD_SHARE = 0.5
# A strip enters a fit if the room with it has less than this share of the misfit of the room without.
_WORTHWHILE = 0.8

_DOING = "look for heat that nobody stated"


def with_suspected_heat(
    background: Background, data: Observations, settings: RoomSettings, marches: Marches
) -> Problem | None:
    """The problem with the best strip and its neighbours as heaters; None if no strip helps enough."""
    strips = floor_strips(background.problem)
    climbs = climbed_each(strips, background, data, settings, marches)
    if min((climb.left for climb in climbs), default=1.0) > _WORTHWHILE:
        return None
    best = min(climbs, key=lambda climb: climb.left)
    # A panel may lie half on one strip and half on the next.
    between = floor_strips(background.problem, between=True)
    halves = [strip for strip in between if share_area(strip.patch, best.strip.patch)]
    best = min(
        (best, *climbed_each(halves, background, data, settings, marches)), key=lambda climb: climb.left
    )
    marches.record({"doing": _DOING, "suspected_k": best.heat_k, "misfit_left": best.left})
    warm = replace(best.strip, temperature_k=best.strip.temperature_k + best.heat_k)
    beside = [strip for strip in (*strips, *between) if adjoin(strip, warm)]
    return with_heaters(
        background.problem, [replace(s, temperature_std_k=_STD_SHARE * best.heat_k) for s in (warm, *beside)]
    )


class Climb(NamedTuple):
    """The best heat of a strip, and its misfit as a share of that of the room without it."""

    left: float
    heat_k: float
    strip: SuspectedHeater


def climbed_each(
    strips: Sequence[SuspectedHeater],
    background: Background,
    data: Observations,
    settings: RoomSettings,
    marches: Marches,
) -> list[Climb]:
    """The best heat of each strip, each tried by itself."""
    cold = with_heaters(background.problem, strips)
    coarse = room(cold.scene, settings.coarse_cells, background.coarse.closure)
    mean = room_prior(cold, coarse.layout).mean
    before = len(mean.heater_excess_k) - len(strips)

    def climb(n: int) -> Climb:
        return Climb(*climbed(before + n, coarse, mean, background, data, settings, marches), strips[n])

    with ThreadPoolExecutor(settings.threads) as pool:
        return list(pool.map(climb, range(len(strips))))


def climbed(
    heater: int,
    coarse: Room,
    mean: RoomParameters,
    background: Background,
    data: Observations,
    settings: RoomSettings,
    marches: Marches,
) -> tuple[float, float]:
    """Least misfit with this heater, over that of the room without it, and its temperature above the air."""
    least, best_k, flow = np.inf, 0.0, background.base.flow.last
    for heat_k in _LADDER_K:
        warm = eqx.tree_at(lambda p: p.heater_excess_k, mean, mean.heater_excess_k.at[heater].add(heat_k))
        tried = march_under(coarse, warm, flow, settings.restart_s, data.vertices, marches)
        left = misfit_ratio(data, tried, background.base)
        if left > least:
            break
        least, best_k, flow = left, heat_k, tried.flow.last
    return least, best_k


def floor_strips(problem: Problem, *, between: bool = False) -> list[SuspectedHeater]:
    """Strips of floor at the temperature of the air, without those that overlap a stated patch.

    `between` gives the strips half-way between these.
    """
    box, scene = problem.scene.room, problem.scene
    edges_m = np.linspace(box.lower_m[0], box.upper_m[0], _STRIPS + 1)
    edges_m = 0.5 * (edges_m[:-1] + edges_m[1:]) if between else edges_m
    middle_m, half_m = box.centre_m[1], 0.5 * _DEPTH_SHARE * box.size_m[1]
    air_k = scene.air.ambient_temperature_k + (leaving_excess_k(problem) or 0.0)
    taken = [b.patch for b in scene.boundary if isinstance(b, OnPatch)]
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
    """The problem with these heaters added."""
    boundary = (*problem.scene.boundary, *heaters)
    return Problem(replace(problem.scene, boundary=boundary), problem.shifts, problem.planes, problem.sensors)
