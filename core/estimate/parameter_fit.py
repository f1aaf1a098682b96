"""The fit of a room's parameters on the fine grid: Gauss-Newton steps, Levenberg-Marquardt's where they mislead.

Derivatives are a coarse room's: one restart for each parameter. They are valid for short steps only. So a room that
fits worse is rejected, and the next step from the best one is shorter; every forward run updates the Jacobian
(Broyden 1965), which is computed anew from time to time. Where walls are unknown, many parameters start far from the
truth and compensate one another: each may be wrong by half the supply's excess temperature. There steps are damped
from the beginning.

Air that does not settle makes each marched room partly chance. So the search ends with the weighted mean of all of
them that fits the data best (`core.estimate.mean_room`).
"""

from collections.abc import Callable

import equinox as eqx
import numpy as np

from core.estimate.forward_runs import Derivatives, ForwardRun, RoomSettings, march_under
from core.estimate.least_squares import LONGEST_STEP, Posterior
from core.estimate.marches import Marches
from core.estimate.mean_room import mean_fields, weights_of_least_misfit
from core.estimate.observation import Observations
from core.estimate.parameter_names import by_name
from core.estimate.parameter_step import Vector, corrected, farthest, misfit_ratio, secant
from core.estimate.prior import Prior
from core.problem import Problem
from core.room.forward import Room

# A round that leaves more than this share of the misfit has gained nothing; after so many of those the rounds end.
_GAIN, _PATIENCE = 0.99, 2

_DOING = "search the fine room's parameters"


class Background(eqx.Module):
    """The room as stated, before any image is used: forward runs on both grids, and the coarse one's derivatives."""

    problem: Problem
    coarse: Room
    fine: Room
    prior: Prior
    base: ForwardRun
    first: ForwardRun
    derivatives: Derivatives


class Fit(eqx.Module):
    """Fitted parameters with their posterior, and the forward run under them."""

    posterior: Posterior
    room: ForwardRun

    @classmethod
    def begun(cls, vector: Vector, room: ForwardRun) -> "Fit":
        """Parameters that no data have been asked about, and the forward run under them."""
        return cls(Posterior(vector, np.eye(len(vector)), np.zeros(0)), room)

    def with_posterior_of(self, other: "Fit") -> "Fit":
        """The same parameters and run, with the covariance of another step."""
        known = other.posterior
        return Fit(Posterior(self.posterior.vector, known.covariance, known.deviation), self.room)


def search(
    fine: Room,
    prior: Prior,
    data: Observations,
    best: Fit,
    derivatives: Derivatives,
    settings: RoomSettings,
    marches: Marches,
    renewed: Callable[[Vector, Vector], Derivatives] | None = None,
) -> tuple[Fit, Derivatives]:
    """The mean of the rooms marched from `best` on that fits the data best, and the last derivatives.

    The derivatives are computed anew by `renewed`, over the parameters' posterior deviations, at most
    `settings.renewals` times: on every other round if the parameters have moved far, and when the rounds no longer
    gain. Without `renewed` they stay as they are.
    """
    far = renewed is not None and bool(prior.unknown_walls())
    longest = LONGEST_STEP if far else None
    linearised = best.posterior.vector
    grid_difference = data.predicted(best.room.fields) - data.predicted(derivatives.start)
    stale, renewals, trust_radius = 0, settings.renewals, longest
    jacobian = derivatives.per_deviation(data.predicted).T
    marched = [best]
    for n in range(settings.rounds):
        asked = corrected(
            best.posterior.vector,
            best.room,
            data,
            jacobian,
            grid_difference,
            gaussian=prior.gaussian(),
            far=far,
            trust_radius=trust_radius,
        )
        where, flow = prior.parameters(asked.vector), best.room.flow.last
        new = Fit(
            asked, march_under(fine, where, flow, settings.refine_s, data.vertices, marches, doing=_DOING)
        )
        marched.append(new)
        left = misfit_ratio(data, new.room, best.room)
        values = by_name(prior, new.posterior.vector)
        marches.record({"doing": _DOING, "round": n + 1.0, "misfit_left": left, **values})
        step = farthest(new.posterior.vector, best.posterior.vector)
        if renewed is not None:
            change = data.predicted(new.room.fields) - data.predicted(best.room.fields)
            jacobian = secant(jacobian, new.posterior.vector - best.posterior.vector, change)
        best, trust_radius = (new, longest) if left < 1.0 else (best.with_posterior_of(new), 0.5 * step)
        stale = 0 if left < _GAIN else stale + 1
        done = step < settings.fine_step or stale == _PATIENCE
        enough = settings.fine_step if done else settings.jacobian_valid
        away = farthest(best.posterior.vector, linearised)
        if renewed is not None and renewals > 0 and (done or n % 2 == 1) and away > enough:
            renewals, linearised, stale, trust_radius = renewals - 1, best.posterior.vector, 0, longest
            derivatives = renewed(linearised, best.posterior.spread)
            jacobian = derivatives.per_deviation(data.predicted).T
        elif done:
            break
    return mean_fit(marched, best, prior, data), derivatives


def mean_fit(marched: list[Fit], best: Fit, prior: Prior, data: Observations) -> Fit:
    """The mean of these rooms that fits the data best, with the covariance and the march of `best`, one of them."""
    rooms = [fit.room.fields for fit in marched]
    nth = [fit.room is best.room for fit in marched].index(True)
    weights = weights_of_least_misfit(data, rooms, nth)
    vector = np.tensordot(weights, np.stack([fit.posterior.vector for fit in marched]), axes=1)
    room = ForwardRun(prior.parameters(vector), best.room.flow, mean_fields(rooms, weights))
    return Fit(Posterior(vector, best.posterior.covariance, best.posterior.deviation), room)
