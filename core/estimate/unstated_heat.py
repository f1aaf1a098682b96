"""A heat source that nobody stated: find the panel of floor that explains the images best.

The coarse room is marched with a heated panel at each of nine places along x, and then, where a view tells y, at each
of nine along y. A view tells where across its line of sight the air rises, but not how far along it: along an axis
that no view tells the panel stays in the middle. A panel is compared by what is left of the residual r, if the change
d that it makes may be scaled and all that the fit moves may move as well:

    c = <r, d> / (|r| |d|),    a = <r, d> / |d|^2,    <f, g> = f^T (R + J J^T)^-1 g

R: variances of the data; J: derivatives in each fitted parameter, per prior deviation, as in the fit's first step. So
warmer walls are told from a plume. Without J a panel would be liked for warming the air at all. A plume beside its
true place, or too strong, would make the misfit itself larger. Each panel is made warmer as long as the correlation c
rises; a times its heat is what the data ask for. With N data that err by themselves, the heat may stand at another
panel (95 %) if N log((1 - c^2) / (1 - c_best^2)), twice the logarithm of their likelihoods' ratio, is below 3.84; the
result says so. The best panel enters the fit as a heater with a prior deviation of half its heat, and so do its
neighbours along each axis that was told.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.estimate.forward_runs import RoomSettings, march_under
from core.estimate.marches import Marches, work
from core.estimate.observation import IMAGES, Observations
from core.estimate.parameter_fit import Background
from core.estimate.parameter_step import variance_of
from core.estimate.prior import room_prior
from core.known import leaving_excess_k, share_area
from core.problem import Problem
from core.room.boundary_conditions import RoomParameters, SuspectedHeater
from core.room.forward import Room, room
from core.scene import Heater, OnPatch, Patch
from core.significance import EITHER_WAY
from core.view_frame import told_on_floor

# Panels along an axis, each overlapping the next by half: five of them cover the floor's length.
_PLACES, _SHARE = 9, 0.2
# Temperatures above the air that are tried. At a heater's usual coefficient 20 K give some 60 W/m2 over about half a
# square metre: the range is from a lamp to a radiator.
_LADDER_K = (15.0, 30.0, 60.0, 120.0)
# Prior deviation of the found heat, as a share of it.
_STD_SHARE = 0.5

_DOING = "look for heat that nobody stated"


class Suspect(NamedTuple):
    """A panel, the heat that the data ask of it, and how its change of the data correlates with what is left.

    `spans_m` is from where to where, along each axis that was searched, heat may stand (95 %).
    """

    likeness: float
    heat_k: float
    panel: SuspectedHeater
    spans_m: tuple[tuple[int, float, float], ...] = ()


class Residual(NamedTuple):
    """What the room as stated leaves of the data, the data's variances, and the derivatives of the fit's first step.

    `before` is what the data would be in that room. Errors that data share are taken out of all but that.
    """

    left: Float[np.ndarray, " data"]
    before: Float[np.ndarray, " data"]
    variance: Float[np.ndarray, " data"]
    jacobian: Float[np.ndarray, "data active"]

    def inner(self, one: Float[np.ndarray, " data"], other: Float[np.ndarray, " data"]) -> float:
        """<one, other> by the inverse of the data's variance and of what the parameters may do."""
        weighted = self.jacobian.T / self.variance
        moved = np.linalg.solve(weighted @ self.jacobian + np.eye(len(weighted)), weighted @ other)
        return float(one @ ((other - self.jacobian @ moved) / self.variance))

    def matched(self, change: Float[np.ndarray, " data"]) -> tuple[float, float]:
        """Correlation of what is left with a change, and the factor on the change that explains most of it."""
        common, own, all_left = (
            self.inner(*of) for of in ((self.left, change), (change, change), (self.left, self.left))
        )
        tiny = float(np.finfo(np.float32).tiny)
        return common / max(float(np.sqrt(own * all_left)), tiny), common / max(own, tiny)


def residual_of(background: Background, data: Observations) -> Residual:
    """The residual of the coarse room as stated."""
    before, finer = (data.predicted(run.fields) for run in (background.base, background.first))
    left = data.values()[0] - before
    variance = variance_of(data, left, finer - before, far=True)
    jacobian = background.derivatives.per_deviation(data.predicted).T
    left, jacobian = (data.unshared(of, variance) for of in (left, jacobian))
    return Residual(left, before, variance, jacobian)


def likeliest(
    background: Background, data: Observations, settings: RoomSettings, marches: Marches
) -> Suspect | None:
    """The panel of floor whose heat explains the data best; None if none explains anything."""
    residual, best, spans_m = residual_of(background, data), None, ()
    middle_m = background.problem.scene.room.centre_m[:2]
    for axis in told_on_floor(background.problem.scene):
        panels = panels_along(background.problem, axis, middle_m)
        suspects = warmed_each(panels, background, residual, data, settings, marches)
        best = max(suspects, key=lambda suspect: suspect.likeness, default=None)
        if best is None or best.likeness <= 0.0:
            return None
        middle_m = best.panel.patch.centre_m
        spans_m = (*spans_m, (axis, *likely_span_m(suspects, axis, independent(data))))
        best = best._replace(spans_m=spans_m)
        marches.record({"doing": _DOING, "suspected_k": best.heat_k, "likeness": best.likeness})
    return best


def independent(data: Observations) -> float:
    """How many of the images' data err by themselves."""
    return float(np.sum(1.0 / data.alike()[data.values()[2] == IMAGES]))


def is_placed(suspect: Suspect, problem: Problem) -> bool:
    """Whether the images tell, along some axis, a place for the heat from others: it may not stand all along it."""
    box = problem.scene.room
    slack_m = 1e-6 * np.array(box.size_m)
    return any(
        low_m > box.lower_m[axis] + slack_m[axis] or high_m < box.upper_m[axis] - slack_m[axis]
        for axis, low_m, high_m in suspect.spans_m
    )


def likely_span_m(suspects: Sequence[Suspect], axis: int, count: float) -> tuple[float, float]:
    """From where to where along an axis heat may stand (95 %), by `count` data that err by themselves."""
    left = np.array([1.0 - suspect.likeness**2 for suspect in suspects])
    likely = count * np.log(left / left.min()) < EITHER_WAY**2
    patches = [suspect.panel.patch for suspect, kept in zip(suspects, likely, strict=True) if kept]
    return min(p.lower_m[axis] for p in patches), max(p.upper_m[axis] for p in patches)


def with_suspected_heat(problem: Problem, suspect: Suspect) -> Problem:
    """The problem with the panel, and its neighbours along each axis that is told, as heaters."""
    warm = replace(suspect.panel, temperature_k=suspect.panel.temperature_k + suspect.heat_k)
    middle_m, size_m = np.array(warm.patch.centre_m), _SHARE * np.array(problem.scene.room.size_m[:2])
    steps_m = [
        side * size_m * (np.arange(2) == axis) for axis in told_on_floor(problem.scene) for side in (-1, 1)
    ]
    beside = _panels(problem, middle_m + np.array(steps_m))
    std_k = _STD_SHARE * suspect.heat_k
    return with_heaters(problem, [replace(panel, temperature_std_k=std_k) for panel in (warm, *beside)])


def warmed_each(
    panels: Sequence[SuspectedHeater],
    background: Background,
    residual: Residual,
    data: Observations,
    settings: RoomSettings,
    marches: Marches,
) -> list[Suspect]:
    """The best heat of each panel, each tried by itself."""
    each = work(background.coarse.grid, settings.restarts_s(background.prior))
    marches.expect(len(panels) * len(_LADDER_K) * each)

    def warmed(panel: SuspectedHeater) -> Suspect:
        cold = with_heaters(background.problem, [panel])
        coarse = room(cold.scene, settings.coarse_cells, background.coarse.closure)
        mean = room_prior(cold, coarse.layout).mean
        return Suspect(*_warmed(coarse, mean, background, residual, data, settings, marches), panel)

    with ThreadPoolExecutor(settings.threads) as pool:
        return list(pool.map(warmed, panels))


def _warmed(
    coarse: Room,
    mean: RoomParameters,
    background: Background,
    residual: Residual,
    data: Observations,
    settings: RoomSettings,
    marches: Marches,
) -> tuple[float, float]:
    """Greatest correlation of the room's last heater, 0 if negative, and the heat that the data ask of it [K]."""
    best, best_k, flow = 0.0, 0.0, background.base.flow.last
    seconds = settings.restarts_s(background.prior)
    for tried_so_far, heat_k in enumerate(_LADDER_K, 1):
        warm = eqx.tree_at(lambda p: p.heater_excess_k, mean, mean.heater_excess_k.at[-1].add(heat_k))
        tried = march_under(coarse, warm, flow, seconds, data.vertices, marches)
        change = data.unshared(data.predicted(tried.fields) - residual.before, residual.variance)
        likeness, scale = residual.matched(change)
        if likeness > best:
            best, best_k = likeness, scale * heat_k
        elif best > 0.0:
            marches.forgo((len(_LADDER_K) - tried_so_far) * work(coarse.grid, seconds))
            break
        flow = tried.flow.last
    return best, best_k


def panels_along(problem: Problem, axis: int, middle_m: Sequence[float]) -> list[SuspectedHeater]:
    """Panels along an axis from wall to wall, through `middle_m` along the other, without those on a stated patch."""
    box = problem.scene.room
    shares = np.linspace(0.5 * _SHARE, 1.0 - 0.5 * _SHARE, _PLACES)
    middles_m = np.tile(np.asarray(middle_m, float), (_PLACES, 1))
    middles_m[:, axis] = box.lower_m[axis] + shares * box.size_m[axis]
    return _panels(problem, middles_m)


def _panels(problem: Problem, middles_m: Float[np.ndarray, "places 2"]) -> list[SuspectedHeater]:
    """Panels as warm as the air around these points; none that leaves the floor or meets a stated patch."""
    box, scene = problem.scene.room, problem.scene
    half_m = 0.5 * _SHARE * np.array(box.size_m[:2])
    air_k = scene.air.ambient_temperature_k + (leaving_excess_k(problem) or 0.0)
    taken = [b.patch for b in scene.boundary if isinstance(b, OnPatch)]
    slack_m = 1e-6 * half_m
    panels = []
    for middle_m in middles_m:
        lower_m, upper_m = middle_m - half_m, middle_m + half_m
        if np.any(lower_m < box.lower_m[:2] - slack_m) or np.any(upper_m > box.upper_m[:2] + slack_m):
            continue
        (x0, y0), (x1, y1) = (
            np.clip(at, box.lower_m[:2], box.upper_m[:2]).tolist() for at in (lower_m, upper_m)
        )
        patch = Patch(wall="z_min", lower_m=(x0, y0), upper_m=(x1, y1))
        if not any(share_area(patch, other) for other in taken):
            panels.append(SuspectedHeater(patch=patch, temperature_k=air_k))
    return panels


def with_heaters(problem: Problem, heaters: Sequence[Heater]) -> Problem:
    """The problem with these heaters added."""
    boundary = (*problem.scene.boundary, *heaters)
    return Problem(replace(problem.scene, boundary=boundary), problem.shifts, problem.planes, problem.sensors)
