"""Parts of the fit that all rounds share: the step, the misfit, the secant update of the Jacobian."""

import numpy as np
from jaxtyping import Bool, Float

from core.estimate.forward_runs import ForwardRun
from core.estimate.least_squares import Posterior, gauss_newton, weighted_variance
from core.estimate.observation import Observations

Vector = Float[np.ndarray, " active"]
Jacobian = Float[np.ndarray, "data active"]


def corrected(
    vector: Vector,
    best: ForwardRun,
    data: Observations,
    jacobian: Jacobian,
    grid_difference: Float[np.ndarray, " data"],
    *,
    gaussian: Bool[np.ndarray, " active"],
    far: bool = False,
    trust_radius: float | None = None,
) -> Posterior:
    """One Gauss-Newton step from `vector`, by the residual of the run `best`.

    `far`: how the data count where the room may be far from the truth (`weighted_variance`).
    """
    residual = data.values()[0] - data.predicted(best.fields)
    weights = variance_of(data, residual, grid_difference, far=far)
    return gauss_newton(
        vector,
        data.unshared(residual, weights),
        weights,
        data.unshared(jacobian, weights),
        gaussian,
        trust_radius=trust_radius,
    )


def variance_of(
    data: Observations,
    residual: Float[np.ndarray, " data"],
    grid_difference: Float[np.ndarray, " data"],
    *,
    far: bool = False,
) -> Float[np.ndarray, " data"]:
    """`weighted_variance` of the data, by what neither the camera nor another shared error explains."""
    _, noise, group = data.values()
    residual, grid_difference = (data.unshared(of, noise) for of in (residual, grid_difference))
    return weighted_variance(noise, data.alike(), group, residual, grid_difference, far=far)


def misfit_ratio(data: Observations, new: ForwardRun, old: ForwardRun) -> float:
    """Misfit of a run over that of another, each datum weighted by its noise and the old run's residual."""
    after, before = (data.values()[0] - data.predicted(a.fields) for a in (new, old))
    weights = variance_of(data, before, before)
    after, before = (data.unshared(of, weights) for of in (after, before))
    return float(np.sqrt(np.sum(after**2 / weights) / max(np.sum(before**2 / weights), 1e-30)))


def farthest(one: Vector, other: Vector) -> float:
    """The largest difference of two sets of parameters, in prior deviations."""
    return float(np.abs(one - other).max(initial=0.0))


def secant(jacobian: Jacobian, moved: Vector, change: Float[np.ndarray, " data"]) -> Jacobian:
    """Broyden's update (1965): the Jacobian nearest to the old one that gives `change` for the step `moved`."""
    return jacobian + np.outer(change - jacobian @ moved, moved) / max(float(moved @ moved), 1e-12)
