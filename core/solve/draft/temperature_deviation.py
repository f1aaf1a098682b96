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

from core.shared_errors import broad, shared_errors
from core.solve.draft.temperature_system import System, Volume

_SMOOTH_VERTICES = 1.5
# A variance below this share of the larger one is lost in the error of the solves (`_DRAWN` of `temperature`).
_ROUGH = 1e-3


def deviation(
    system: System, solve: Callable[[Volume], Volume], draws: int
) -> tuple[Float[np.ndarray, "nx ny nz"], Float[np.ndarray, "nx ny nz errors"]]:
    """One sigma of n from `draws` draws, one at least, and what of it the whole field has together.

    That is one sigma of each of one or two independent errors (`core.shared_errors`). `solve` inverts the Hessian,
    roughly.
    """
    shape = system.grid.shape
    shared = shared_errors(np.stack([solve(one) for one in broad(shape)]), _ROUGH)
    random, square = np.random.default_rng(0), np.zeros(shape)
    for _ in range(draws):
        # What the solves cannot tell apart stays with the draws.
        square += shared.without(solve(_perturbation(system, random))) ** 2
    rest = gaussian_filter(square / draws, _SMOOTH_VERTICES, mode="nearest")
    return np.sqrt(rest + np.sum(shared.fields**2, axis=0)), np.moveaxis(shared.fields, 0, -1)


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
