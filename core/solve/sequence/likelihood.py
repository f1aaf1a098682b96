"""Which random field makes the bursts of a sequence likeliest: its size, its length, and the pictures' noise.

Burst b has the whitened data d_b = A a_b + e_b, with the weights a_b of the modes and noise e_b of variance tau. The
weights are independent, of standard deviations sigma s_m(l) (`modes.amplitudes`). n bursts about their own mean are
n - 1 independent contrasts. With rho = sigma^2 / tau,

    -2 log likelihood = (n - 1) [D log tau + log det H] + Q / tau,      H = 1 + rho s A^T A s,
    Q = sum_b |d_b|^2 - rho g_b^T H^-1 g_b,      g_b = s A^T d_b,

for D numbers a burst. The best tau is Q / ((n - 1) D). Source: Rasmussen & Williams (2006), 5.4.1. Added is a belief:
air that moves is no colder and no warmer than air elsewhere in the room, so sigma^2 / spread^2, with the spread of
the temperature in the mean room (a half-normal distribution). It counts where the pictures say little.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from core.solve.sequence.modes import Modes

# Of the logarithms of the length and of the ratio of variances, at the likelihood's maximum.
_TOLERANCE = 0.02
# Von Karman's spectrum has most energy in waves of 2 pi (5/6)^(1/2) lengths: the longest that a room holds is twice
# its shortest edge. The shortest length is what the modes hold.
_LONGEST = 2.0 / (2.0 * np.pi * (5 / 6) ** 0.5)
# How far the search goes from a field that shows as much as the noise.
_RATIOS = 16.0
# Sizes over which the expectation is taken, in parts of the spread of the mean room; rounds of noise and ratio.
_LEAST, _MOST, _SIZES, _ROUNDS = 1e-3, 5.0, 500, 4


@dataclass(frozen=True)
class SeenModes:
    """What the windows say of the modes, whitened: A^T A, A^T d for each burst, sum |d|^2, and D."""

    normal: Float[np.ndarray, "modes modes"]
    score: Float[np.ndarray, "modes bursts"]
    square: float
    count: int

    def and_(self, other: "SeenModes") -> "SeenModes":
        """Both views' windows."""
        return SeenModes(
            self.normal + other.normal,
            self.score + other.score,
            self.square + other.square,
            self.count + other.count,
        )


@dataclass(frozen=True)
class ModesPosterior:
    """The likeliest field and what the bursts say under it.

    `std_k` (expected) and `length_m` are the field's, `noise` the factor on the variance of the shifts, `weights` the
    modes' posterior means. The posterior's covariance is root root^T, the same for every burst.
    """

    std_k: float
    length_m: float
    noise: float
    weights: Float[np.ndarray, "modes bursts"]
    root: Float[np.ndarray, "modes modes"]


def likeliest(modes: Modes, seen: SeenModes, spread_k: float) -> ModesPosterior:
    """The likeliest length, size and noise, and the posterior there; `spread_k` is that of T in the mean room [K]."""
    shortest_m, longest_m = 2.0 / modes.finest_per_m, _LONGEST * min(modes.box.size_m)
    # A field that shows as much as the noise does.
    even = -float(np.log(np.trace(seen.normal) / seen.count))
    best = minimize(
        lambda at: _Tried(modes, seen, at).unlikely(spread_k),
        [0.5 * np.log(shortest_m * longest_m), even],
        method="Nelder-Mead",
        bounds=[tuple(np.log([shortest_m, longest_m])), (even - _RATIOS, even + _RATIOS)],
        options={"xatol": _TOLERANCE, "fatol": 0.1},
    )
    length_m = float(np.exp(best.x[0]))
    size = modes.amplitudes(length_m)
    values, vectors = np.linalg.eigh(size[:, None] * seen.normal * size)
    root = size[:, None] * vectors
    score = root.T @ seen.score
    std_k, noise = _expected(np.maximum(values, 0.0), score, seen, spread_k)
    left = 1.0 / (1.0 + std_k**2 / noise * np.maximum(values, 0.0))
    weights = root @ ((std_k**2 / noise * left)[:, None] * score)
    return ModesPosterior(std_k, length_m, noise, weights, std_k * root * left**0.5)


def _expected(
    values: Float[np.ndarray, " modes"],
    score: Float[np.ndarray, "modes bursts"],
    seen: SeenModes,
    spread_k: float,
) -> tuple[float, float]:
    """The root of the expected sigma^2, and tau there: where the pictures say nothing, sigma is what is believed.

    `values` are the eigenvalues of s A^T A s, `score` is U^T s A^T d.
    """
    squares, contrasts = (score**2).sum(axis=1), score.shape[1] - 1

    def noise_of(ratio: np.ndarray) -> np.ndarray:
        explained = (ratio[:, None] * squares / (1.0 + ratio[:, None] * values)).sum(axis=1)
        return np.maximum(seen.square - explained, 1e-12 * seen.square) / (contrasts * seen.count)

    sigma_k = spread_k * np.exp(np.linspace(np.log(_LEAST), np.log(_MOST), _SIZES))
    # The noise hardly depends on the field, so the ratio follows from the noise of no field, and once more.
    noise = noise_of(np.zeros(_SIZES))
    for _ in range(_ROUNDS):
        noise = noise_of(sigma_k**2 / noise)
    log_det = np.log1p((sigma_k**2 / noise)[:, None] * values).sum(axis=1)
    unlikely = contrasts * (seen.count * np.log(noise) + log_det) + (sigma_k / spread_k) ** 2
    # Even steps of the logarithm: the steps of sigma are as sigma is.
    weight = sigma_k * np.exp(-0.5 * (unlikely - unlikely.min()))
    expected_k = float(np.sqrt(np.average(sigma_k**2, weights=weight)))
    return expected_k, float(np.average(noise, weights=weight))


class _Tried:
    """The likelihood at a length and a ratio (both as logarithms)."""

    def __init__(self, modes: Modes, seen: SeenModes, at: Float[np.ndarray, "2"]) -> None:
        length_m, self.ratio = (float(one) for one in np.exp(at))
        self.size = modes.amplitudes(length_m)
        matrix = self.ratio * self.size[:, None] * seen.normal * self.size
        matrix[np.diag_indices_from(matrix)] += 1.0
        self.factor = cho_factor(matrix, overwrite_a=True, check_finite=False)
        self.score = self.size[:, None] * seen.score
        explained = self.ratio * float((self.score * cho_solve(self.factor, self.score)).sum())
        contrasts = seen.score.shape[1] - 1
        self.noise = max(seen.square - explained, 1e-12 * seen.square) / (contrasts * seen.count)
        log_det = 2.0 * float(np.log(np.diagonal(self.factor[0])).sum())
        self._data = contrasts * (seen.count * float(np.log(self.noise)) + log_det)

    def unlikely(self, spread_k: float) -> float:
        """Minus twice the logarithm of the likelihood and the belief."""
        return self._data + self.ratio * self.noise / spread_k**2
