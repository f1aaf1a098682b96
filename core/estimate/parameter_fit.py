"""The fit of a room's parameters: Gauss-Newton rounds on a coarse grid, then on a fine one.

The Jacobian comes from one restart of the coarse room for each parameter. Where walls are unknown the rounds on the
fine grid are those of `core.estimate.levenberg_marquardt`.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.estimate.forward_runs import Derivatives, ForwardRun, RoomSettings, march_under, perturbed
from core.estimate.heaters import heaters_by_march
from core.estimate.least_squares import Posterior
from core.estimate.marches import Marches
from core.estimate.observation import Observations
from core.estimate.parameter_names import by_name
from core.estimate.parameter_step import Vector, corrected, farthest, misfit_ratio
from core.estimate.prior import Prior
from core.problem import Problem
from core.room.forward import Room

# Ratios of a room's misfit to the least misfit so far. Above the first a step is rejected: smaller rises may come
# from a march that is not quite steady yet. A round above the second has gained nothing; after `PATIENCE` of those
# the rounds end. The room that is returned is below the last.
REJECTED, GAIN, _ACCEPTED = 1.5, 0.99, 1.05
PATIENCE = 2


class Background(eqx.Module):
    """The room as stated, before any image is used: forward runs on both grids, and the coarse one's derivatives."""

    problem: Problem
    coarse: Room
    fine: Room
    prior: Prior
    base: ForwardRun
    first: ForwardRun
    derivatives: Derivatives


def coarse_fit(
    background: Background, data: Observations, settings: RoomSettings, marches: Marches
) -> tuple[Vector, ForwardRun, Derivatives]:
    """Parameters fitted on the coarse grid, the forward run under them, and its derivatives.

    The coarse grid's own error, its difference from the fine grid under the stated parameters, is taken off the
    residual so that it moves no parameter. Heat coefficients of heaters are found first (`heaters_by_march`). Unknown
    walls are not fitted here: the coarse grid's remaining error would move them.
    """
    coarse, prior, base, derivatives = (
        background.coarse,
        background.prior,
        background.base,
        background.derivatives,
    )
    vector = linearised = np.zeros(len(prior.active()))
    spread = np.ones(len(vector))
    finer = data.predicted(background.first.fields) - data.predicted(base.fields)
    moves = settings.use_images and not prior.unknown_walls()
    if moves:
        vector, base = heaters_by_march(coarse, prior, data, base, finer, settings, marches)
    if np.any(vector):
        derivatives, base = perturbed(coarse, prior, vector, spread, base, settings, data.vertices, marches)
        linearised = vector
    for n in range(settings.coarse_rounds if moves else 0):
        # The grids' difference changes as the parameters move: half of it counts as representation error.
        jacobian = derivatives.per_deviation(data.predicted).T
        new = corrected(
            vector,
            base,
            data,
            jacobian,
            0.5 * finer,
            gaussian=prior.gaussian(),
            offset=finer,
            all_gaussian=True,
        ).vector
        if farthest(new, vector) < settings.coarse_step:
            break
        where, seconds = prior.parameters(new), settings.restart_s
        flow, doing = base.flow.last, "correct the coarse room"
        tried = march_under(coarse, where, flow, seconds, data.vertices, marches, doing=doing)
        left = misfit_ratio(data, tried, base, finer)
        marches.record({"doing": doing, "coarse_round": n + 1.0, "misfit_left": left, **by_name(prior, new)})
        if left > settings.least_gain:
            break
        vector, base = new, tried
        if farthest(vector, linearised) > settings.jacobian_valid:
            derivatives, base = perturbed(
                coarse, prior, vector, spread, base, settings, data.vertices, marches
            )
            linearised = vector
    if np.any(vector != linearised):
        derivatives, base = perturbed(coarse, prior, vector, spread, base, settings, data.vertices, marches)
    return vector, base, derivatives


class Fit(eqx.Module):
    """Fitted parameters with their posterior, and the forward run under them."""

    posterior: Posterior
    room: ForwardRun

    def with_posterior_of(self, other: "Fit") -> "Fit":
        """The same parameters and run, with the covariance of another step."""
        known = other.posterior
        return Fit(Posterior(self.posterior.vector, known.covariance, known.deviation), self.room)


def fine_fit(
    fine: Room,
    prior: Prior,
    data: Observations,
    vector: Vector,
    first: ForwardRun,
    derivatives: Derivatives,
    settings: RoomSettings,
    marches: Marches,
) -> Fit:
    """Gauss-Newton rounds on the fine grid; without images the room as stated.

    For a few parameters that are nearly right: the last steps change little more than a march's unsteadiness does.
    """
    best = least = Fit(Posterior(vector, np.eye(len(vector)), np.zeros(0)), first)
    grid_difference = data.predicted(first.fields) - data.predicted(derivatives.start)
    stale = 0
    for n in range(settings.rounds if settings.use_images else 0):
        new, left = fine_round(
            n, fine, prior, data, best, least, derivatives, grid_difference, settings, marches
        )
        if left > REJECTED:
            best = best.with_posterior_of(new)
            break
        step = farthest(new.posterior.vector, best.posterior.vector)
        best, stale = new, 0 if left < GAIN else stale + 1
        least = new if left < 1.0 else least
        if step < settings.fine_step or stale == PATIENCE:
            break
    if misfit_ratio(data, best.room, least.room) > _ACCEPTED:
        best = least.with_posterior_of(best)
    return best


def fine_round(
    n: int,
    fine: Room,
    prior: Prior,
    data: Observations,
    best: Fit,
    least: Fit,
    derivatives: Derivatives,
    grid_difference: Float[np.ndarray, " data"],
    settings: RoomSettings,
    marches: Marches,
) -> tuple[Fit, float]:
    """One step and the forward run under it, and its misfit over the least one; half the step if all is rejected.

    The derivatives are a coarser grid's, so a step may be too long.
    """
    jacobian = derivatives.per_deviation(data.predicted).T
    asked = corrected(
        best.posterior.vector, best.room, data, jacobian, grid_difference, gaussian=prior.gaussian()
    )
    new, left = best, np.inf
    for share in (1.0, 0.5):
        vector = best.posterior.vector + share * (asked.vector - best.posterior.vector)
        flow = best.room.flow.last
        where, doing = prior.parameters(vector), "correct the fine room"
        tried = march_under(fine, where, flow, settings.refine_s, data.vertices, marches, doing=doing)
        new, left = (
            Fit(Posterior(vector, asked.covariance, asked.deviation), tried),
            misfit_ratio(data, tried, least.room),
        )
        values = by_name(prior, vector)
        marches.record({"doing": doing, "round": n + 2.0 - share, "misfit_left": left, **values})
        if left <= REJECTED:
            break
    return new, left
