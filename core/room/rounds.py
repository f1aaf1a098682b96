"""A room's parameters, corrected round by round: on a coarse grid while that pays, then on a fine one.

One restart a parameter says what each would change; the misfit with the data moves them by Gauss-Newton. At
last the room is held at the temperatures that measurements say.
"""

from collections.abc import Callable

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from core.problem import Problem
from core.room.fit import Posterior, gauss_newton, weighted_variance
from core.room.hold import to_hold_k
from core.room.observe import Observations
from core.room.prior import Prior
from core.room.room import Room
from core.room.runs import Attempt, Derivatives, Event, RoomSettings, attempt, perturbed

Vector = Float[np.ndarray, " active"]

# A correction that leaves more than this of the least misfit so far did harm: the room before it is kept. Below
# it, the room may only not have settled yet; what is given back leaves no more than its own wobble above the least.
# After so many rounds that take less than a hundredth off the misfit the derivatives have no more to say.
_HARM, _GAIN, _PATIENCE, _WOBBLE = 1.5, 0.99, 2, 1.05


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
    Walls that nobody knows are left to the fine room: the coarse one's own errors would move them. Not so where
    heat is suspected that nobody stated: without it the room is another one.
    """
    coarse, prior, base, derivatives = begun.coarse, begun.prior, begun.base, begun.derivatives
    vector = linearised = np.zeros(len(prior.active()))
    finer = data.predicted(begun.first.seen) - data.predicted(base.seen)
    suspected = prior.suspected().any()
    moves = settings.use_images and (suspected or not prior.unknown_walls())
    rounds = settings.coarse_rounds if moves else 0
    straight = settings.straight_walls if suspected else settings.straight
    # Air above a heater is slow to follow its derivatives: what brings it any nearer is a step on the way.
    worthwhile = 1.0 if suspected else settings.worthwhile
    for n in range(rounds):
        # Where the parameters have moved, half of what was taken off may be wrong.
        new = corrected(
            vector, base, data, derivatives, 0.5 * finer, firm=prior.firm(), offset=finer, trusting=True
        ).vector
        if farthest(new, vector) < settings.coarse_step:
            break
        where, seconds = prior.parameters(new), settings.restart_s
        tried = attempt(coarse, where, base.flow.last, seconds, data.vertices, tell)
        left = misfit_ratio(data, tried, base, finer)
        tell({"coarse_round": n + 1.0, "misfit_left": left, **fitted(prior, new)})
        if left > worthwhile:
            break
        vector, base = new, tried
        if farthest(vector, linearised) > straight:
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

    Where walls are unknown those are `made_again` after every other round that moved far, `settings.again` times.
    """
    best = least = Fit(Posterior(vector, np.eye(len(vector)), np.zeros(0)), first)
    grid_difference = data.predicted(first.seen) - data.predicted(derivatives.start)
    stale, again, linearised = 0, settings.again if prior.unknown_walls() else 0, vector
    for n in range(settings.rounds if settings.use_images else 0):
        new, left = fine_round(
            n, fine, prior, data, best, least, derivatives, grid_difference, settings, tell
        )
        if left > _HARM:
            best = best.known_as(new)
            break
        step = farthest(new.posterior.vector, best.posterior.vector)
        best, stale = new, 0 if left < _GAIN else stale + 1
        least = new if left < 1.0 else least
        if again > 0 and n % 2 == 1 and farthest(new.posterior.vector, linearised) > settings.straight_walls:
            # Not from a room that went astray.
            best = least.known_as(best) if left > _WOBBLE else best
            again, linearised, stale = again - 1, best.posterior.vector, 0
            derivatives = made_again(linearised)
        elif step < settings.fine_step or stale == _PATIENCE:
            break
    if misfit_ratio(data, best.room, least.room) > _WOBBLE:
        best = least.known_as(best)
    return best, derivatives


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
    tell: Event,
) -> tuple[Fit, float]:
    """One step from the best room and its march, half of it where all did harm; its misfit over the least one.

    The derivatives are a coarser room's, so a step may be too long.
    """
    asked = corrected(best.posterior.vector, best.room, data, derivatives, grid_difference, firm=prior.firm())
    new, left = best, np.inf
    for share in (1.0, 0.5):
        vector = best.posterior.vector + share * (asked.vector - best.posterior.vector)
        flow = best.room.flow.last
        tried = attempt(fine, prior.parameters(vector), flow, settings.refine_s, data.vertices, tell)
        new, left = (
            Fit(Posterior(vector, asked.covariance, asked.deviation), tried),
            misfit_ratio(data, tried, least.room),
        )
        tell({"round": n + 2.0 - share, "misfit_left": left, **fitted(prior, vector)})
        if left <= _HARM:
            break
    return new, left


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
    derivatives: Derivatives,
    grid_difference: Float[np.ndarray, " data"],
    *,
    firm: Bool[np.ndarray, " active"],
    offset: Float[np.ndarray, " data"] | float = 0.0,
    trusting: bool = False,
) -> Posterior:
    """One Gauss-Newton step from `vector` by the misfit of `best`, `offset` added to what it shows."""
    values, variance, group = data.values()
    jacobian = derivatives.per_deviation(data.predicted).T
    residual = values - data.predicted(best.seen) - offset
    weights = weighted_variance(variance, group, residual, grid_difference)
    return gauss_newton(vector, residual, weights, jacobian, firm, trusting=trusting)


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
