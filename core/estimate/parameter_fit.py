"""A room's parameters, corrected round by round: on a coarse grid while that pays, then on a fine one.

One restart a parameter says what each would change; the misfit with the data moves them by Gauss-Newton. Where
walls are unknown, `core.estimate.levenberg_marquardt` does so. At last the room is held at
the temperatures that measurements say.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from core.estimate.forward_runs import Derivatives, Event, ForwardRun, RoomSettings, march_under, perturbed
from core.estimate.heaters import heaters_by_march
from core.estimate.least_squares import Posterior
from core.estimate.observation import Observations
from core.estimate.parameter_step import Vector, by_name, corrected, farthest, misfit_ratio
from core.estimate.prior import Prior
from core.estimate.temperature_nudging import to_hold_k
from core.problem import Problem
from core.room.forward import Room

# A correction that leaves more than this of the least misfit so far did harm: the room before it is kept. Below
# it, the room may only not have settled yet; what is given back leaves no more than its own wobble above the least.
# After so many rounds that take less than a hundredth off the misfit the derivatives have no more to say.
_HARM, GAIN, PATIENCE, _WOBBLE = 1.5, 0.99, 2, 1.05


class Background(eqx.Module):
    """A room before any image, as stated: both grids settled, and the coarse one's derivatives."""

    problem: Problem
    coarse: Room
    fine: Room
    prior: Prior
    base: ForwardRun
    first: ForwardRun
    derivatives: Derivatives


def coarse_fit(
    background: Background, data: Observations, settings: RoomSettings, report: Event
) -> tuple[Vector, ForwardRun, Derivatives]:
    """Parameters that the coarse room asks for, the room under them, and the runs of its Jacobian.

    What the coarse grid gets wrong is taken from the fine one under the stated parameters, so that it moves none.
    Far from where it was made a Jacobian misleads: a new one is made after every `settings.jacobian_valid` prior
    deviations.
    What stated heaters give off is found before, by marches. Walls that nobody knows are left to the fine room: the
    coarse one's own errors would move them.
    """
    coarse, prior, base, derivatives = (
        background.coarse,
        background.prior,
        background.base,
        background.derivatives,
    )
    vector = linearised = np.zeros(len(prior.active()))
    finer = data.predicted(background.first.fields) - data.predicted(base.fields)
    moves = settings.use_images and not prior.unknown_walls()
    if moves:
        vector, base = heaters_by_march(coarse, prior, data, base, finer, settings, report)
    if np.any(vector):
        derivatives, linearised = perturbed(coarse, prior, vector, base, settings, data.vertices), vector
    for n in range(settings.coarse_rounds if moves else 0):
        # Where the parameters have moved, half of what was taken off may be wrong.
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
        tried = march_under(coarse, where, base.flow.last, seconds, data.vertices, report)
        left = misfit_ratio(data, tried, base, finer)
        report({"coarse_round": n + 1.0, "misfit_left": left, **by_name(prior, new)})
        if left > settings.least_gain:
            break
        vector, base = new, tried
        if farthest(vector, linearised) > settings.jacobian_valid:
            derivatives, linearised = perturbed(coarse, prior, vector, base, settings, data.vertices), vector
    if np.any(vector != linearised):
        derivatives = perturbed(coarse, prior, vector, base, settings, data.vertices)
    return vector, base, derivatives


class Fit(eqx.Module):
    """Parameters that a fine room was marched under, what data leave open of them, and that room."""

    posterior: Posterior
    room: ForwardRun

    def with_posterior_of(self, other: "Fit") -> "Fit":
        """The same room, with what data leave open by another's."""
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
    report: Event,
) -> Fit:
    """The fine room's parameters and best march; as stated without images.

    For few parameters that are nearly right: what is left to move is little more than a march's wobble.
    """
    best = least = Fit(Posterior(vector, np.eye(len(vector)), np.zeros(0)), first)
    grid_difference = data.predicted(first.fields) - data.predicted(derivatives.start)
    stale = 0
    for n in range(settings.rounds if settings.use_images else 0):
        new, left = fine_round(
            n, fine, prior, data, best, least, derivatives, grid_difference, settings, report
        )
        if left > _HARM:
            best = best.with_posterior_of(new)
            break
        step = farthest(new.posterior.vector, best.posterior.vector)
        best, stale = new, 0 if left < GAIN else stale + 1
        least = new if left < 1.0 else least
        if step < settings.fine_step or stale == PATIENCE:
            break
    if misfit_ratio(data, best.room, least.room) > _WOBBLE:
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
    report: Event,
) -> tuple[Fit, float]:
    """One step from the best room and its march, half of it where all did harm; its misfit over the least one.

    The derivatives are a coarser room's, so a step may be too long.
    """
    jacobian = derivatives.per_deviation(data.predicted).T
    asked = corrected(
        best.posterior.vector, best.room, data, jacobian, grid_difference, gaussian=prior.gaussian()
    )
    new, left = best, np.inf
    for share in (1.0, 0.5):
        vector = best.posterior.vector + share * (asked.vector - best.posterior.vector)
        flow = best.room.flow.last
        tried = march_under(fine, prior.parameters(vector), flow, settings.refine_s, data.vertices, report)
        new, left = (
            Fit(Posterior(vector, asked.covariance, asked.deviation), tried),
            misfit_ratio(data, tried, least.room),
        )
        report({"round": n + 2.0 - share, "misfit_left": left, **by_name(prior, vector)})
        if left <= _HARM:
            break
    return new, left


def held_fit(
    fine: Room,
    prior: Prior,
    data: Observations,
    before: ForwardRun,
    derivatives: Derivatives,
    settings: RoomSettings,
    report: Event,
) -> ForwardRun:
    """The room `before` kept at the mean temperatures that measurements say, the longest march last.

    A level, or a profile, that parameters miss bends the jets: a room that has it right has the better velocity.
    """
    held, left = before, 1.0
    for seconds in (settings.refine_s, settings.final_s):
        held_k = to_hold_k(data, prior, derivatives, held, before, fine.layout)
        held = march_under(
            fine, before.parameters, held.flow.last, seconds, data.vertices, report, held_k=held_k
        )
        left = misfit_ratio(data, held, before)
        report({"held_s": seconds, "misfit_left": left})
    return before if left > _WOBBLE else held
