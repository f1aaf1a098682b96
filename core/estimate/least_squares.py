"""One Gauss-Newton step on a room's uncertain parameters, with a Jacobian from a coarser room.

    minimise  |d - f(q)|^2 / (s^2 + c r^2)  +  sum log(1 + q^2 / nu) (nu + 1),  nu = 3

q are the parameters in units of their prior deviations. s is each datum's own noise; r is the representation
error, estimated for each kind of data; c is how many data share it (`Observations.alike`).
The prior is Student's t, so that the data can overrule an entry that is wrong by many deviations. The closure's
viscosity, which nobody enters, has a Gaussian prior: with a Student's t it would move in place of a wrong supply.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.stats import norm

from core.estimate.observation import IMAGES

_STUDENT_NU = 3.0
# Share of the data that the model's error is taken from; the rest may be edges of jets.
_COUNTED = 0.95
LONGEST_STEP = 3.0


class Posterior(eqx.Module):
    """Fitted parameters in prior deviations, their covariance, and the standard deviation of each datum."""

    vector: Float[np.ndarray, " active"]
    covariance: Float[np.ndarray, "active active"]
    deviation: Float[np.ndarray, " data"]

    @property
    def spread(self) -> Float[np.ndarray, " active"]:
        """Each parameter's deviation."""
        return np.sqrt(np.diag(self.covariance))


def gauss_newton(
    vector: Float[np.ndarray, " active"],
    residual: Float[np.ndarray, " data"],
    variance: Float[np.ndarray, " data"],
    jacobian: Float[np.ndarray, "data active"],
    gaussian: Bool[np.ndarray, " active"],
    *,
    trust_radius: float | None = None,
) -> Posterior:
    """One step from `vector`, where `residual` is the data minus the prediction.

    Without a `trust_radius` each parameter's step is limited by itself, so that one wrong entry may move far.
    With it the whole step is damped until no parameter moves by more: where parameters compensate one another,
    limiting them one by one would spoil that.

    `gaussian` marks parameters with a Gaussian prior.
    """
    new, normal, prior = vector, np.eye(len(vector)), np.ones(len(vector))
    for _ in range(6):
        student = (_STUDENT_NU + 1.0) / (_STUDENT_NU + new**2)
        prior = np.where(gaussian, 1.0, student)
        normal = (jacobian.T / variance) @ jacobian + np.diag(prior)
        gradient = (jacobian.T / variance) @ residual - prior * vector
        if trust_radius is None:
            new = vector + np.clip(np.linalg.solve(normal, gradient), -LONGEST_STEP, LONGEST_STEP)
        else:
            new = vector + damped(normal, gradient, trust_radius)
    data = normal - np.diag(prior)
    # For the posterior every prior is Gaussian with unit deviation, also where the Student weight was small.
    return Posterior(new, np.linalg.inv(data + np.eye(len(new))), np.sqrt(variance))


def damped(
    normal: Float[np.ndarray, "active active"], gradient: Float[np.ndarray, " active"], longest: float
) -> Float[np.ndarray, " active"]:
    """The Gauss-Newton step, damped (Levenberg 1944) until no parameter moves by more than `longest`."""
    damping, step = 0.0, np.linalg.solve(normal, gradient)
    while np.abs(step).max(initial=0.0) > longest:
        damping = max(2.0 * damping, 0.1)
        step = np.linalg.solve(normal + damping * np.eye(len(step)), gradient)
    return step


def weighted_variance(
    variance: Float[np.ndarray, " data"],
    alike: Float[np.ndarray, " data"],
    group: Int[np.ndarray, " data"],
    residual: Float[np.ndarray, " data"],
    grid_difference: Float[np.ndarray, " data"],
    *,
    far: bool = False,
) -> Float[np.ndarray, " data"]:
    """Noise of each datum, and its representation error times how many data share it (`alike`).

    The representation error of a kind of data is the difference of two grids, or what the misfit has beyond the noise
    if that is smaller. With `far` the latter counts for images in any case: far from the truth their derivatives
    are no better than that, and a stated supply or a thermometer must not yield to them.
    """
    total = np.zeros_like(variance)
    for g in np.unique(group):
        own = group == g
        wrong = beyond_noise(residual[own], variance[own])
        if g != IMAGES or not far:
            wrong = min(wrong, beyond_noise(grid_difference[own], np.zeros(own.sum())))
        total[own] = variance[own] + alike[own] * wrong
    return total


def beyond_noise(values: Float[np.ndarray, " some"], variance: Float[np.ndarray, " some"]) -> float:
    """The variance that values have beyond that of their noise; 0 where they have less.

    Values over their deviation are then spread as those of a normal distribution. Of twenty values the largest is not
    counted: the edges of jets must not dominate.
    """
    count = int(np.ceil(_COUNTED * len(values)))
    at = norm.ppf(0.5 + 0.5 * count / len(values))
    normal = 1.0 if count == len(values) else 1.0 - 2.0 * at * norm.pdf(at) * len(values) / count
    low, high = 0.0, float(np.square(values).max()) / normal
    for _ in range(40):
        middle = 0.5 * (low + high)
        size = np.sort(np.square(values) / np.maximum(variance + middle, np.finfo(float).tiny))[:count]
        low, high = (middle, high) if size.mean() > normal else (low, middle)
    return float(0.5 * (low + high))


def spread(values: Float[np.ndarray, " some"]) -> float:
    """Rms without the largest twentieth: the edges of jets must not dominate."""
    size = np.sort(np.abs(values))
    return float(np.sqrt(np.mean(size[: int(np.ceil(_COUNTED * len(size)))] ** 2)))
