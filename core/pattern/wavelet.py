"""Wavelet noise (Cook & DeRose, "Wavelet Noise", SIGGRAPH 2005): band-limited to an octave a band.

    N = R - up(down(R))        noise(x) = sum_i N_i B(x / spacing - i)

R is white, down and up are the quadratic B-spline's analysis and refinement, B the quadratic B-spline:
what a coarser spline can hold is removed, so that bands an octave apart do not overlap.
"""

import numpy as np
import scipy.sparse
from jaxtyping import Float
from scipy.ndimage import convolve1d

from core.scene import WaveletPattern

# Analysis filter of the uniform quadratic B-spline (Cook & DeRose, appendix 1), right half.
_DOWN_HALF = [
    0.655340, 0.033979, -0.243780, -0.025936, 0.103311, 0.011655, -0.044412, -0.005040,
    0.019120, 0.002172, -0.008233, -0.000938, 0.003546, 0.000410, -0.001528, 0.000334,
]  # fmt: skip
_LEAST_STD = 1e-9
_UP = np.array([0.25, 0.75, 0.75, 0.25])


def wavelet_noise(pattern: WaveletPattern, rows: int, cols: int) -> Float[np.ndarray, "rows cols"]:
    """Zero-mean noise of unit standard deviation: `bands` octaves of equal power, float64."""
    total = np.zeros((rows, cols))
    for band in range(pattern.bands):
        # The band ends at half a cycle a spacing, so its finest period is two spacings.
        spacing_px = pattern.finest_px / 2 * 2**band
        noise = _band(np.random.default_rng([pattern.seed, band]), rows, cols, spacing_px)
        # A band coarser than the whole pattern is nearly constant there, and adds nothing.
        total += noise / max(float(noise.std()), _LEAST_STD)
    return (total - total.mean()) / max(float(total.std()), _LEAST_STD)


def _band(
    rng: np.random.Generator, rows: int, cols: int, spacing_px: float
) -> Float[np.ndarray, "rows cols"]:
    shape = tuple(_coefficients(pixels, spacing_px) for pixels in (rows, cols))
    over_rows, over_cols = (_spline_weights(n, spacing_px) for n in (rows, cols))
    white = rng.standard_normal(shape)
    coarse = white
    for axis in (0, 1):
        coarse = _up(_down(coarse, axis), axis)
    return np.asarray((over_cols @ (over_rows @ (white - coarse)).T).T)


def _coefficients(pixels: int, spacing_px: float) -> int:
    count = int(np.ceil((pixels - 1) / spacing_px)) + 4
    return count + count % 2


def _spline_weights(pixels: int, spacing_px: float) -> scipy.sparse.csr_matrix:
    """Quadratic B-spline weights of each pixel on periodic coefficients."""
    place = np.arange(pixels) / spacing_px
    count = _coefficients(pixels, spacing_px)
    middle = np.rint(place).astype(int)
    t = middle - place + 0.5
    weights = np.stack([t**2 / 2, 0.75 - (t - 0.5) ** 2, (1 - t) ** 2 / 2])
    columns = (middle[None] + np.array([[-1], [0], [1]])) % count
    lines = np.broadcast_to(np.arange(pixels), columns.shape)
    return scipy.sparse.csr_matrix((weights.ravel(), (lines.ravel(), columns.ravel())), shape=(pixels, count))


def _down(values: np.ndarray, axis: int) -> np.ndarray:
    # Symmetric about the middle between samples 2i and 2i + 1.
    taps = np.array(_DOWN_HALF[::-1] + _DOWN_HALF)
    filtered = convolve1d(values, taps, axis=axis, mode="wrap", origin=-1)
    return filtered.take(np.arange(0, values.shape[axis], 2), axis=axis)


def _up(values: np.ndarray, axis: int) -> np.ndarray:
    shape = list(values.shape)
    shape[axis] *= 2
    spread = np.zeros(shape)
    index = [slice(None)] * values.ndim
    index[axis] = slice(0, None, 2)
    spread[tuple(index)] = values
    return convolve1d(spread, _UP, axis=axis, mode="wrap", origin=0)
