"""How uncertain `draft` is: posterior draws, each one more solve of the same quadratic problem.

A term 1/2 |R (n - a)|^2 of the objective gets R^T e for white noise e on the right hand side: the solution of the
sum is a draw of the posterior (perturb and optimise). What is left of the prior after the measurements is then in
the scatter of the draws, smoothed: neighbours stand in for more draws. The room's mean and the rise of its profile
have one value a draw, and are often what is least certain. So their covariance is computed, by a solve each, and the
draws tell what is left when both are known.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.fft import idctn
from scipy.ndimage import gaussian_filter

from core.solve.draft.temperature_system import System, Volume

_SMOOTH_VERTICES = 1.5
# The room's mean and its profile's rise.
BROAD = 2
# A variance below this share of the larger one is lost in the error of the solves (`_DRAWN` of `temperature`).
_ROUGH = 1e-3


def deviation(
    system: System, solve: Callable[[Volume], Volume], draws: int
) -> tuple[Float[np.ndarray, "nx ny nz"], Float[np.ndarray, "nx ny nz errors"]]:
    """One sigma of n from `draws` draws, one at least, and what of it the whole field has together.

    That is one sigma of each of one or two independent errors, of what goes with the mean and the rise. `solve`
    inverts the Hessian, roughly.
    """
    shape = system.grid.shape
    broad = np.stack([np.full(shape, 1.0 / np.prod(shape)), rise_of(shape)]).reshape(BROAD, -1)
    answers = np.stack([solve(one.reshape(shape)).ravel() for one in broad])
    covariance = broad @ answers.T
    variances, ways = np.linalg.eigh((covariance + covariance.T) / 2)
    # What is lost stays with the draws.
    told = variances > _ROUGH * variances[-1]
    broad, answers = ways[:, told].T @ broad, ways[:, told].T @ answers
    # How n goes with one sigma of each.
    with_them = answers / np.sqrt(variances[told])[:, None]
    random, square = np.random.default_rng(0), np.zeros(shape)
    for _ in range(draws):
        drawn = solve(_perturbation(system, random)).ravel()
        sigmas = broad @ drawn / np.sqrt(variances[told])
        square += np.reshape(drawn - sigmas @ with_them, shape) ** 2
    shared = np.reshape(with_them.T, (*shape, -1))
    rest = gaussian_filter(square / draws, _SMOOTH_VERTICES, mode="nearest")
    return np.sqrt(rest + np.sum(shared**2, axis=-1)), shared


def rise_of(shape: tuple[int, int, int]) -> Volume:
    """The field whose product with a temperature is its rise from floor to ceiling, by least squares over height."""
    height = np.linspace(-0.5, 0.5, shape[2])
    rise = height / (np.sum(height**2) * shape[0] * shape[1])
    return np.broadcast_to(rise, shape).copy()


def _perturbation(system: System, random: np.random.Generator) -> Volume:
    """White noise through the transposed root of every term."""
    shape, known = system.grid.shape, system.known
    total = np.zeros(shape)
    for operator, weight in zip(system.operators, system.weights, strict=True):
        values, vectors = np.linalg.eigh(weight)
        drawn = np.sqrt(np.maximum(values, 0.0)) * random.standard_normal(values.shape)
        total += operator.transpose(np.einsum("wab,wb->wa", vectors, drawn))
    count = int(known.mask.sum())
    total[known.mask] += random.standard_normal(count) / (known.std_k[known.mask] * system.per_k)
    for members, _, std in known.means:
        total.reshape(-1)[members] += random.standard_normal() / (len(members) * std * system.per_k)
    prior = np.sqrt(system.precision) * random.standard_normal(shape)
    return np.asarray(total + np.asarray(idctn(prior, norm="ortho")))
