"""How uncertain `draft` is: posterior draws, each one more solve of the same quadratic problem.

A term 1/2 |R (n - a)|^2 of the objective gets R^T e for white noise e on the right hand side: the solution of the
sum is a draw of the posterior (perturb and optimise). What is left of the prior after the measurements is then in
the scatter of the draws, smoothed.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.fft import idctn
from scipy.ndimage import gaussian_filter

from core.solve.draft.temperature_system import System, Volume

_SMOOTH_VERTICES = 1.5


def deviation(
    system: System, solve: Callable[[Volume], Volume], draws: int, seed: int
) -> Float[np.ndarray, "nx ny nz"]:
    """One sigma of n from `draws` draws; `solve` inverts the Hessian, roughly."""
    random = np.random.default_rng(seed)
    square = np.zeros(system.grid.shape)
    for _ in range(draws):
        square += solve(_perturbation(system, random)) ** 2
    return np.sqrt(gaussian_filter(square / max(draws, 1), _SMOOTH_VERTICES, mode="nearest"))


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
