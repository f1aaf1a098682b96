"""Gauss-Newton on a room's uncertain parameters, with a Jacobian from a coarser room.

    minimise  |d - f(q)|^2 / (s^2 + r^2) / c  +  sum log(1 + q^2 / nu) (nu + 1),  nu = 3

q are parameters in units of their prior deviations. s is each datum's noise, r what the grid cannot
represent, estimated from the residual of each kind of data; c counts neighbouring data that err together.
The prior is Student's: a supply that was entered wrongly by many sigma is let go, and said. The closure's
viscosity, which nobody enters, keeps a Gaussian one: else it is let go in a wrong supply's place.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from core.data_error import CORRELATED_DATA
from core.estimate.observation import IMAGES, PLANES

_STUDENT_NU = 3.0
LONGEST_STEP = 3.0


class Posterior(eqx.Module):
    """Fitted parameters in prior units, their covariance, and the deviation of each datum."""

    vector: Float[np.ndarray, " active"]
    covariance: Float[np.ndarray, "active active"]
    deviation: Float[np.ndarray, " data"]


def gauss_newton(
    vector: Float[np.ndarray, " active"],
    residual: Float[np.ndarray, " data"],
    variance: Float[np.ndarray, " data"],
    jacobian: Float[np.ndarray, "data active"],
    gaussian: Bool[np.ndarray, " active"],
    *,
    all_gaussian: bool = False,
    trust_radius: float | None = None,
) -> Posterior:
    """One step from `vector`, where the data minus the prediction is `residual`.

    Few parameters' steps are cut one by one, which lets an entry that is far off move all the way. Many
    that make up for one another would no longer do so: they are damped until none moves by more than `trust_radius`.

    `gaussian` parameters keep a Gaussian prior; `all_gaussian` keeps that of all: for first steps, when the model is
    still far from the data.
    """
    new, normal, prior = vector, np.eye(len(vector)), np.ones(len(vector))
    for _ in range(6):
        student = (_STUDENT_NU + 1.0) / (_STUDENT_NU + new**2)
        prior = np.where(gaussian | all_gaussian, 1.0, student)
        normal = (jacobian.T / variance) @ jacobian + np.diag(prior)
        gradient = (jacobian.T / variance) @ residual - prior * vector
        if trust_radius is None:
            new = vector + np.clip(np.linalg.solve(normal, gradient), -LONGEST_STEP, LONGEST_STEP)
        else:
            new = vector + damped(normal, gradient, trust_radius)
    data = normal - np.diag(prior)
    # A parameter that was let go is no more certain than its prior, were there no data; one near it no less.
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
    group: Int[np.ndarray, " data"],
    residual: Float[np.ndarray, " data"],
    grid_difference: Float[np.ndarray, " data"],
    *,
    far: bool = False,
) -> Float[np.ndarray, " data"]:
    """Noise plus representation error of each datum, times the number of neighbours that err together.

    The representation error of a kind of data is what two grids differ by, or the misfit where that is less. `far`
    from the truth the images' derivatives are no better than their misfit: all of it counts, so that they ask for no
    more than they can report, and a stated supply or a thermometer holds against them.
    """
    total = np.zeros_like(variance)
    for g in np.unique(group):
        own = group == g
        error = spread(residual[own])
        if g != IMAGES or not far:
            error = min(error, spread(grid_difference[own]))
        total[own] = (variance[own] + error**2) * (CORRELATED_DATA if g in (IMAGES, PLANES) else 1.0)
    return total


def spread(values: Float[np.ndarray, " some"]) -> float:
    """Rms with the largest twentieth left out: jets' edges must not hide the rest."""
    size = np.sort(np.abs(values))
    return float(np.sqrt(np.mean(size[: max(1, int(0.95 * len(size)))] ** 2)))
