"""Heat that nobody stated: warm strips of the floor, where the images ask for them.

Where walls are unknown, so is whether a heater stands on one. A room that no wall's temperature, supply or
closure brings near the images is given strips of floor below the middle of the view, one beside the other, each
with a temperature of its own: where the air rises the images show, how deep in the room they do not.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool

from core.problem import Problem
from core.room.balance import outflow_excess_k
from core.room.fit import gauss_newton, weighted_variance
from core.room.observe import Observations
from core.room.openings import share_area
from core.room.rounds import Begun
from core.room.setup import SuspectedHeater
from core.scene import Heater, Inlet, Outlet, Patch

_STRIPS, _DEPTH_SHARE = 5, 0.2
# At a heater's coefficient so many kelvin are some 60 W/m2.
_STRIP_STD_K = 20.0
# A room whose derivatives leave less than this of the images has its heat where it was stated; strips are kept
# where they leave less than that share of what the room leaves without them.
_EXPLAINED, _WORTHWHILE = 0.55, 0.8


def with_suspected_heaters(problem: Problem) -> Problem:
    """The problem with strips of floor whose temperature nobody knows, wherever no other patch lies."""
    box, scene = problem.scene.room, problem.scene
    edges_m = np.linspace(box.lower_m[0], box.upper_m[0], _STRIPS + 1)
    middle_m, half_m = box.centre_m[1], 0.5 * _DEPTH_SHARE * box.size_m[1]
    air_k = scene.air.ambient_temperature_k + (outflow_excess_k(problem) or 0.0)
    taken = [b.patch for b in scene.boundary if isinstance(b, Inlet | Outlet | Heater)]
    strips = []
    for low_m, high_m in pairwise(edges_m):
        lower, upper = (float(low_m), middle_m - half_m), (float(high_m), middle_m + half_m)
        patch = Patch(wall="z_min", lower_m=lower, upper_m=upper)
        if not any(share_area(patch, other) for other in taken):
            strips.append(SuspectedHeater(patch=patch, temperature_k=air_k, temperature_std_k=_STRIP_STD_K))
    boundary = (*scene.boundary, *strips)
    return Problem(replace(scene, boundary=boundary), problem.shifts, problem.planes, problem.sensors)


def unexplained_as_stated(begun: Begun, data: Observations) -> bool:
    """Whether the derivatives of all that may be wrong leave more of the images than a room without its heat may."""
    return _left(begun, data, np.ones(len(begun.prior.active()), bool)) > _EXPLAINED


def explained_by_strips(suspected: Begun, data: Observations) -> bool:
    """Whether strips bring the room much nearer to the images than everything else does."""
    stated = ~suspected.prior.suspected()
    return _left(suspected, data, np.ones_like(stated)) < _WORTHWHILE * _left(suspected, data, stated)


def _left(begun: Begun, data: Observations, moved: Bool[np.ndarray, " active"]) -> float:
    """Share (rms) of the measured shifts that one step of the `moved` parameters leaves, by the derivatives."""
    values, variance, group = data.values()
    seen = data.predicted(begun.first.seen)
    finer = seen - data.predicted(begun.base.seen)
    jacobian = begun.derivatives.per_deviation(data.predicted).T * moved
    weights = weighted_variance(variance, group, values - seen, 0.5 * finer)
    start = np.zeros(len(moved))
    step = gauss_newton(start, values - seen, weights, jacobian, begun.prior.firm(), trusting=True).vector
    left, shifts = values - seen - jacobian @ step, group == 0
    return float(np.linalg.norm(left[shifts]) / max(float(np.linalg.norm(values[shifts])), 1e-30))
