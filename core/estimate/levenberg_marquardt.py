"""The fit on the fine grid where walls are unknown: Levenberg-Marquardt with Broyden's updates.

Here many parameters start far from the truth and compensate one another: each wall may be wrong by half the supply's
excess temperature. Derivatives of a coarse room are valid for short steps only, so steps are damped, a room that fits
worse is rejected, every forward run updates the Jacobian, and the Jacobian is computed anew from time to time.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from core.estimate.forward_runs import Derivatives, ForwardRun, RoomSettings, march_under
from core.estimate.least_squares import LONGEST_STEP, Posterior
from core.estimate.marches import Marches
from core.estimate.observation import Observations
from core.estimate.parameter_fit import GAIN, PATIENCE, Fit
from core.estimate.parameter_names import by_name
from core.estimate.parameter_step import Jacobian, Vector, corrected, farthest, misfit_ratio, secant
from core.estimate.prior import Prior
from core.room.forward import Room

_DOING = "search the fine room's parameters"


def fine_search(
    fine: Room,
    prior: Prior,
    data: Observations,
    first: ForwardRun,
    derivatives: Derivatives,
    renewed: Callable[[Vector, Vector], Derivatives],
    settings: RoomSettings,
    marches: Marches,
) -> tuple[Fit, Derivatives]:
    """The parameters and forward run of least misfit, and the last derivatives.

    The derivatives are computed anew by `renewed`, over the parameters' posterior deviations, at most
    `settings.renewals` times: on every other round if the parameters have moved far, and when the rounds no longer
    gain.
    """
    linearised = np.zeros(len(prior.active()))
    best = Fit(Posterior(linearised, np.eye(len(linearised)), np.zeros(0)), first)
    grid_difference = data.predicted(first.fields) - data.predicted(derivatives.start)
    stale, renewals, trust_radius = 0, settings.renewals, LONGEST_STEP
    jacobian = derivatives.per_deviation(data.predicted).T
    for n in range(settings.rounds):
        new = searched(fine, prior, data, best, jacobian, grid_difference, trust_radius, settings, marches)
        left = misfit_ratio(data, new.room, best.room)
        values = by_name(prior, new.posterior.vector)
        marches.record({"doing": _DOING, "round": n + 1.0, "misfit_left": left, **values})
        change = data.predicted(new.room.fields) - data.predicted(best.room.fields)
        jacobian = secant(jacobian, new.posterior.vector - best.posterior.vector, change)
        step = farthest(new.posterior.vector, best.posterior.vector)
        best, trust_radius = (new, LONGEST_STEP) if left < 1.0 else (best.with_posterior_of(new), 0.5 * step)
        stale = 0 if left < GAIN else stale + 1
        done = step < settings.fine_step or stale == PATIENCE
        enough = settings.fine_step if done else settings.jacobian_valid_walls
        away = farthest(best.posterior.vector, linearised)
        if renewals > 0 and (done or n % 2 == 1) and away > enough:
            renewals, linearised, stale, trust_radius = renewals - 1, best.posterior.vector, 0, LONGEST_STEP
            derivatives = renewed(linearised, best.posterior.spread)
            jacobian = derivatives.per_deviation(data.predicted).T
        elif done:
            break
    return best, derivatives


def searched(
    fine: Room,
    prior: Prior,
    data: Observations,
    best: Fit,
    jacobian: Jacobian,
    grid_difference: Float[np.ndarray, " data"],
    trust_radius: float,
    settings: RoomSettings,
    marches: Marches,
) -> Fit:
    """One damped step from the best room, and the forward run under the new parameters."""
    where, gaussian = best.posterior.vector, prior.gaussian()
    asked = corrected(
        where, best.room, data, jacobian, grid_difference, gaussian=gaussian, trust_radius=trust_radius
    )
    parameters, flow = prior.parameters(asked.vector), best.room.flow.last
    seconds, seen_on = settings.refine_s, data.vertices
    return Fit(asked, march_under(fine, parameters, flow, seconds, seen_on, marches, doing=_DOING))
