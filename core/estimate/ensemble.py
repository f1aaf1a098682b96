"""The fit where a motion of the camera may hide what the air does: an ensemble of rooms instead of differences.

Without the picture's mean shift and gradient, single differences of rooms mislead: a fit by them ends far from the
truth. Here rooms are drawn from the prior and marched on the coarse grid. A linear model of the data in the
parameters is regressed on the members: a slope over their whole spread, which a march's unsteadiness and a jet that
turns disturb less. What the fine room leaves of the measurements then moves the members' mean and narrows their
spread, with a share of the measurements' weight that grows from round to round to 1.

Sources: Emerick and Reynolds, Computers & Geosciences 55 (2013), for the shares; Bocquet and Sakov, Q. J. R.
Meteorol. Soc. 140 (2014), for the regressed slopes.
"""

from concurrent.futures import ThreadPoolExecutor

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from core.estimate.forward_runs import Derivatives, ForwardRun, RoomSettings, march_under
from core.estimate.least_squares import Posterior, gauss_newton, weighted_variance
from core.estimate.marches import Marches
from core.estimate.observation import Observations
from core.estimate.parameter_fit import GAIN, PATIENCE, Background
from core.estimate.parameter_names import by_name
from core.estimate.parameter_step import misfit_ratio, secant
from core.estimate.prior import Prior
from core.room.forward import Room
from core.room.step import Flow
from core.room.vertices import RoomFields

Vectors = Float[np.ndarray, "members active"]

_DOING, _MEMBERS = "correct the room", "march an ensemble of coarse rooms"


class EnsembleFit(eqx.Module):
    """Corrected parameters, the fine room and a coarse one under them, and derivatives.

    `stated` are the derivatives over the members' first spread, which is the prior's, `derivatives` over their last.
    """

    posterior: Posterior
    room: ForwardRun
    flow: Flow
    stated: Derivatives
    derivatives: Derivatives


def ensemble_fit(
    background: Background, data: Observations, settings: RoomSettings, marches: Marches
) -> EnsembleFit:
    """Correct the background's parameters by the data."""
    coarse, fine, prior = background.coarse, background.fine, background.prior
    values, noise, group = data.values()
    vectors, room = drawn(len(prior.active())), background.first
    posterior = Posterior(vectors.mean(0), np.eye(vectors.shape[1]), np.zeros(0))
    flows = [background.base.flow.last] * len(vectors)
    runs = marched(coarse, prior, vectors, flows, settings, data.vertices, marches)
    stated = derivatives = derivatives_of(vectors, runs)
    jacobian, stale = derivatives.per_deviation(data.predicted).T, 0
    for n in range(settings.ensemble_rounds):
        predicted, share = data.predicted(room.fields), min(1.0, (n + 1) / settings.growing_rounds)
        finer = predicted - data.predicted(derivatives.start)
        variance = weighted_variance(noise, group, values - predicted, finer, far=True)
        found = gauss_newton(
            posterior.vector, values - predicted, variance / share, jacobian, prior.gaussian()
        )
        if share < 1.0 and n % 2 == 1:
            vectors = redrawn(vectors, found)
            flows = [run.flow.last for run in runs]
            runs = marched(coarse, prior, vectors, flows, settings, data.vertices, marches)
            derivatives = derivatives_of(vectors, runs)
            jacobian = derivatives.per_deviation(data.predicted).T
        where, flow, seconds = prior.parameters(found.vector), room.flow.last, settings.refine_s
        tried = march_under(fine, where, flow, seconds, data.vertices, marches, doing=_DOING)
        left = misfit_ratio(data, tried, room)
        marches.record(
            {"doing": _DOING, "round": n + 1.0, "misfit_left": left, **by_name(prior, found.vector)}
        )
        moved = found.vector - posterior.vector
        jacobian = secant(jacobian, moved, data.predicted(tried.fields) - predicted)
        stale = stale + 1 if share == 1.0 and left > GAIN else 0
        if share == 1.0 and left >= 1.0:
            posterior = Posterior(posterior.vector, found.covariance, found.deviation)
        else:
            posterior, room = found, tried
        if stale == PATIENCE:
            break
    nearest = int(np.argmin(np.linalg.norm(vectors - posterior.vector, axis=1)))
    return EnsembleFit(posterior, room, runs[nearest].flow.last, stated, derivatives)


def drawn(active: int) -> Vectors:
    """Twice as many members as parameters, and two, of mean 0 and covariance 1 exactly."""
    members = 2 * (active + 1)
    normal = np.random.default_rng(0).standard_normal((members, active))
    return np.linalg.qr(normal - normal.mean(0))[0] * (members - 1) ** 0.5


def redrawn(vectors: Vectors, posterior: Posterior) -> Vectors:
    """The members, moved and stretched to the posterior's mean and covariance."""
    apart = vectors - vectors.mean(0)
    before = np.linalg.cholesky(apart.T @ apart / (len(vectors) - 1))
    after = np.linalg.cholesky(posterior.covariance)
    return posterior.vector + np.linalg.solve(before, apart.T).T @ after.T


def marched(
    where: Room,
    prior: Prior,
    vectors: Vectors,
    flows: list[Flow],
    settings: RoomSettings,
    vertices: tuple[int, int, int],
    marches: Marches,
) -> list[ForwardRun]:
    """Every member, marched on from its flow."""

    def one(n: int) -> ForwardRun:
        parameters = prior.parameters(vectors[n])
        return march_under(where, parameters, flows[n], settings.restart_s, vertices, marches)

    found: list[ForwardRun] = []
    with ThreadPoolExecutor(settings.threads) as pool:
        for run in pool.map(one, range(len(vectors))):
            found.append(run)
            marches.record({"doing": _MEMBERS, "moved": float(len(found)), "of": float(len(vectors))})
    return found


def derivatives_of(vectors: Vectors, runs: list[ForwardRun]) -> Derivatives:
    """The members' mean fields, and what differs from member to member."""

    def mean(*parts: np.ndarray) -> np.ndarray:
        return np.mean(np.stack([np.asarray(part) for part in parts]), axis=0)

    fields: list[RoomFields] = [run.fields for run in runs]
    return Derivatives(jax.tree.map(mean, *fields), fields, vectors - vectors.mean(0))
