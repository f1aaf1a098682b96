"""A heat source that nobody stated: find the strip of floor that explains the images best.

The coarse room is marched with a heated panel on each of five strips of floor in turn, and then on the two strips
half-way to the neighbours of the best one. A panel is compared by what it would leave of the images' residual r if
the change d that it makes could be scaled:

    |r - a d|^2 / |r|^2 = 1 - c^2,    c = <r, d> / (|r| |d|),    a = <r, d> / |d|^2

A plume beside its true place, or too strong, would make the misfit itself larger. Each panel is made warmer as long
as the correlation c rises; a times its heat is what the images ask for. One view shows where along x the air rises
but not how deep in the room, so the strips lie in the middle of the room's depth. The best strip enters the fit as a
heater with a prior deviation of half its heat, and so do its neighbours on both sides.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.estimate.forward_runs import RoomSettings, march_under
from core.estimate.image_noise import unshared
from core.estimate.marches import Marches
from core.estimate.observation import IMAGES, Observations
from core.estimate.parameter_fit import Background
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

_DOING = "look for heat that nobody stated"


class Suspect(NamedTuple):
    """A strip, the heat that the images ask of it, and how its change of the images correlates with what is left."""

    likeness: float
    heat_k: float
    strip: SuspectedHeater


def likeliest(
    background: Background, data: Observations, settings: RoomSettings, marches: Marches
) -> Suspect | None:
    """The strip of floor whose heat explains the images best; None if none explains anything."""
    strips = floor_strips(background.problem)
    suspects = warmed_each(strips, background, data, settings, marches)
    if max((suspect.likeness for suspect in suspects), default=0.0) <= 0.0:
        return None
    best = max(suspects, key=lambda suspect: suspect.likeness)
    # A panel may lie half on one strip and half on the next.
    between = floor_strips(background.problem, between=True)
    halves = [strip for strip in between if share_area(strip.patch, best.strip.patch)]
    best = max(
        (best, *warmed_each(halves, background, data, settings, marches)),
        key=lambda suspect: suspect.likeness,
    )
    marches.record({"doing": _DOING, "suspected_k": best.heat_k, "likeness": best.likeness})
    return best


def with_suspected_heat(problem: Problem, suspect: Suspect) -> Problem:
    """The problem with the strip and its neighbours as heaters."""
    strips = (strip for between in (False, True) for strip in floor_strips(problem, between=between))
    warm = replace(suspect.strip, temperature_k=suspect.strip.temperature_k + suspect.heat_k)
    beside = [strip for strip in strips if adjoin(strip, warm)]
    std_k = _STD_SHARE * suspect.heat_k
    return with_heaters(problem, [replace(strip, temperature_std_k=std_k) for strip in (warm, *beside)])


def warmed_each(
    strips: Sequence[SuspectedHeater],
    background: Background,
    data: Observations,
    settings: RoomSettings,
    marches: Marches,
) -> list[Suspect]:
    """The best heat of each strip, each tried by itself."""
    cold = with_heaters(background.problem, strips)
    coarse = room(cold.scene, settings.coarse_cells, background.coarse.closure)
    mean = room_prior(cold, coarse.layout).mean
    before = len(mean.heater_excess_k) - len(strips)

    def warmed(n: int) -> Suspect:
        return Suspect(*_warmed(before + n, coarse, mean, background, data, settings, marches), strips[n])

    with ThreadPoolExecutor(settings.threads) as pool:
        return list(pool.map(warmed, range(len(strips))))


def _warmed(
    heater: int,
    coarse: Room,
    mean: RoomParameters,
    background: Background,
    data: Observations,
    settings: RoomSettings,
    marches: Marches,
) -> tuple[float, float]:
    """Greatest correlation with this heater, 0 if it is negative, and the heat that the images ask of it [K]."""
    values, variance, group = data.values()
    images = group == IMAGES
    before = data.predicted(background.base.fields)
    best, best_k, flow = 0.0, 0.0, background.base.flow.last
    seconds = settings.restarts_s(background.prior)
    for heat_k in _LADDER_K:
        warm = eqx.tree_at(lambda p: p.heater_excess_k, mean, mean.heater_excess_k.at[heater].add(heat_k))
        tried = march_under(coarse, warm, flow, seconds, data.vertices, marches)
        change = data.predicted(tried.fields) - before
        left, change = (unshared(data, of[images]) for of in (values - before, change))
        likeness, scale = matched(left, change, variance[images])
        if likeness <= best:
            break
        best, best_k, flow = likeness, scale * heat_k, tried.flow.last
    return best, best_k


def matched(
    left: Float[np.ndarray, " data"], change: Float[np.ndarray, " data"], noise: Float[np.ndarray, " data"]
) -> tuple[float, float]:
    """Correlation of what is left with a change, and the factor on the change that explains most of what is left.

    Each datum counts by its noise and by how large what is left is on the mean.
    """
    weight = 1.0 / (noise + np.mean(left**2))
    common, own, all_left = (float(np.sum(weight * f)) for f in (left * change, change**2, left**2))
    tiny = float(np.finfo(np.float32).tiny)
    return common / max(float(np.sqrt(own * all_left)), tiny), common / max(own, tiny)


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
