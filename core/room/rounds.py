"""A room's parameters, corrected round by round: on a coarse grid while that pays, then on a fine one.

One restart a parameter says what each would change; the misfit with the data moves them by Gauss-Newton. At
last the room is held at the temperatures that measurements say.
"""

from collections.abc import Callable

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from core.problem import Problem
from core.room.fit import LONGEST_STEP, Posterior, gauss_newton, weighted_variance
from core.room.hold import to_hold_k
from core.room.observe import Observations
from core.room.prior import Prior
from core.room.room import Room
from core.room.runs import Attempt, Derivatives, Event, RoomSettings, attempt, perturbed

Vector = Float[np.ndarray, " active"]
Jacobian = Float[np.ndarray, "data active"]

# A held room that leaves more than this of the misfit of the one before is not kept: less is a march's own wobble.
# After so many rounds that take less than a hundredth off the misfit the derivatives have no more to say.
_WOBBLE, _GAIN, _PATIENCE = 1.05, 0.99, 2


class Begun(eqx.Module):
    """A room before any image, as stated: both grids settled, and the coarse one's derivatives."""

    problem: Problem
    coarse: Room
    fine: Room
    prior: Prior
    base: Attempt
    first: Attempt
    derivatives: Derivatives


def coarse_fit(
    begun: Begun, data: Observations, settings: RoomSettings, tell: Event
) -> tuple[Vector, Attempt, Derivatives]:
    """Parameters that the coarse room asks for, the room under them, and the runs of its Jacobian.

    What the coarse grid gets wrong is taken from the fine one under the stated parameters, so that it moves none.
    Far from where it was made a Jacobian misleads: it is made anew after every `settings.straight` prior deviations.
    Walls that nobody knows are left to the fine room: the coarse one's own errors would move them.
    """
    coarse, prior, base, derivatives = begun.coarse, begun.prior, begun.base, begun.derivatives
    vector = linearised = np.zeros(len(prior.active()))
    finer = data.predicted(begun.first.seen) - data.predicted(base.seen)
    moves = settings.use_images and not prior.unknown_walls()
    rounds = settings.coarse_rounds if moves else 0
    for n in range(rounds):
        # Where the parameters have moved, half of what was taken off may be wrong.
        jacobian = derivatives.per_deviation(data.predicted).T
        new = corrected(
            vector, base, data, jacobian, 0.5 * finer, firm=prior.firm(), offset=finer, trusting=True
        ).vector
        if farthest(new, vector) < settings.coarse_step:
            break
        where, seconds = prior.parameters(new), settings.restart_s
        tried = attempt(coarse, where, base.flow.last, seconds, data.vertices, tell)
        left = misfit_ratio(data, tried, base, finer)
        tell({"coarse_round": n + 1.0, "misfit_left": left, **fitted(prior, new)})
        if left > settings.worthwhile:
            break
        vector, base = new, tried
        if farthest(vector, linearised) > settings.straight:
            derivatives, linearised = perturbed(coarse, prior, vector, base, settings, data.vertices), vector
    if np.any(vector != linearised):
        derivatives = perturbed(coarse, prior, vector, base, settings, data.vertices)
    return vector, base, derivatives


class Fit(eqx.Module):
    """Parameters that a fine room was marched under, what data leave open of them, and that room."""

    posterior: Posterior
    room: Attempt

    def known_as(self, other: "Fit") -> "Fit":
        """The same room, with what data leave open by another's."""
        known = other.posterior
        return Fit(Posterior(self.posterior.vector, known.covariance, known.deviation), self.room)


def fine_fit(
    fine: Room,
    prior: Prior,
    data: Observations,
    vector: Vector,
    first: Attempt,
    derivatives: Derivatives,
    made_again: Callable[[Vector], Derivatives],
    settings: RoomSettings,
    tell: Event,
) -> tuple[Fit, Derivatives]:
    """The fine room's parameters and best march, and the last derivatives; as stated without images.

    A room that is farther from the data than the one before is not gone on from: the next step is shorter. Where
    walls are unknown derivatives are `made_again` after every other round that moved far, and where the old ones
    have no more to say, `settings.again` times.
    """
    best = Fit(Posterior(vector, np.eye(len(vector)), np.zeros(0)), first)
    grid_difference = data.predicted(first.seen) - data.predicted(derivatives.start)
    stale, again, linearised = 0, settings.again if prior.unknown_walls() else 0, vector
    reach, jacobian = LONGEST_STEP, derivatives.per_deviation(data.predicted).T
    for n in range(settings.rounds if settings.use_images else 0):
        new = fine_round(fine, prior, data, best, jacobian, grid_difference, reach, settings, tell)
        left, moved = misfit_ratio(data, new.room, best.room), new.posterior.vector - best.posterior.vector
        tell({"round": n + 1.0, "misfit_left": left, **fitted(prior, new.posterior.vector)})
        change = data.predicted(new.room.seen) - data.predicted(best.room.seen)
        jacobian = secant(jacobian, moved, change)
        step = float(np.abs(moved).max(initial=0.0))
        best, reach = (new, LONGEST_STEP) if left < 1.0 else (best.known_as(new), 0.5 * step)
        stale = 0 if left < _GAIN else stale + 1
        done = (step < settings.fine_step and left > _GAIN) or stale == _PATIENCE
        away = farthest(best.posterior.vector, linearised)
        if (
            again > 0
            and away > (settings.fine_step if done else settings.straight_walls)
            and (done or n % 2 == 1)
        ):
            again, linearised, stale, reach = again - 1, best.posterior.vector, 0, LONGEST_STEP
            derivatives = made_again(linearised)
            jacobian = derivatives.per_deviation(data.predicted).T
        elif done:
            break
    return best, derivatives


def fine_round(
    fine: Room,
    prior: Prior,
    data: Observations,
    best: Fit,
    jacobian: Jacobian,
    grid_difference: Float[np.ndarray, " data"],
    reach: float,
    settings: RoomSettings,
    tell: Event,
) -> Fit:
    """One step from the best room, in which no parameter moves by more than `reach`, and its march."""
    where, firm = best.posterior.vector, prior.firm()
    asked = corrected(where, best.room, data, jacobian, grid_difference, firm=firm, longest=reach)
    parameters, flow = prior.parameters(asked.vector), best.room.flow.last
    return Fit(asked, attempt(fine, parameters, flow, settings.refine_s, data.vertices, tell))


def secant(jacobian: Jacobian, moved: Vector, change: Float[np.ndarray, " data"]) -> Jacobian:
    """The Jacobian that agrees with what a move did, as near to the old one as can be (Broyden 1965)."""
    return jacobian + np.outer(change - jacobian @ moved, moved) / max(float(moved @ moved), 1e-12)


def held_fit(
    fine: Room,
    prior: Prior,
    data: Observations,
    before: Attempt,
    derivatives: Derivatives,
    settings: RoomSettings,
    tell: Event,
) -> Attempt:
    """The room `before` kept at the mean temperatures that measurements say, the longest march last.

    A level, or a profile, that parameters miss bends the jets: a room that has it right has the better velocity.
    """
    held, left = before, 1.0
    for seconds in (settings.refine_s, settings.final_s):
        held_k = to_hold_k(data, prior, derivatives, held, before, fine.layout)
        held = attempt(fine, before.parameters, held.flow.last, seconds, data.vertices, tell, held_k=held_k)
        left = misfit_ratio(data, held, before)
        tell({"held_s": seconds, "misfit_left": left})
    return before if left > _WOBBLE else held


def corrected(
    vector: Vector,
    best: Attempt,
    data: Observations,
    jacobian: Jacobian,
    grid_difference: Float[np.ndarray, " data"],
    *,
    firm: Bool[np.ndarray, " active"],
    offset: Float[np.ndarray, " data"] | float = 0.0,
    trusting: bool = False,
    longest: float = LONGEST_STEP,
) -> Posterior:
    """One Gauss-Newton step from `vector` by the misfit of `best`, `offset` added to what it shows."""
    values, variance, group = data.values()
    residual = values - data.predicted(best.seen) - offset
    weights = weighted_variance(variance, group, residual, grid_difference)
    return gauss_newton(vector, residual, weights, jacobian, firm, trusting=trusting, longest=longest)


def misfit_ratio(
    data: Observations, new: Attempt, old: Attempt, offset: Float[np.ndarray, " data"] | float = 0.0
) -> float:
    """Rms misfit of one attempt over another's, each kind of data weighted by the old one's."""
    values, variance, group = data.values()
    after, before = (values - data.predicted(a.seen) - offset for a in (new, old))
    weights = weighted_variance(variance, group, before, before)
    return float(np.sqrt(np.sum(after**2 / weights) / max(np.sum(before**2 / weights), 1e-30)))


def farthest(one: Vector, other: Vector) -> float:
    """The largest difference of two sets of parameters, in prior deviations."""
    return float(np.abs(one - other).max(initial=0.0))


def fitted(prior: Prior, vector: Vector) -> dict[str, float]:
    """Parameters by name, in deviations from their priors."""
    return dict(zip(prior.names(), (float(v) for v in vector), strict=True))
