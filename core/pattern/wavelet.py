"""Wavelet noise (Cook & DeRose, "Wavelet Noise", SIGGRAPH 2005): band-limited to an octave a band.

    N = R - up(down(R))        noise(x) = sum_i N_i B(x / spacing - i)

R is white, down and up are the quadratic B-spline's analysis and refinement, B the quadratic B-spline:
what a coarser spline can hold is removed, so that bands an octave apart do not overlap.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

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
_STRIP_PIXELS = 2**20
_UP = np.array([0.25, 0.75, 0.75, 0.25])


@dataclass(frozen=True)
class _Band:
    """One octave: B-spline coefficients and each pixel's weights on them, so that any rectangle can be made."""

    coefficients: Float[np.ndarray, "n m"]
    over_rows: scipy.sparse.csr_matrix
    over_cols: scipy.sparse.csr_matrix

    def part(self, rows: slice, cols: slice) -> Float[np.ndarray, "rows cols"]:
        return np.asarray((self.over_cols[cols] @ (self.over_rows[rows] @ self.coefficients).T).T)


def wavelet_noise(pattern: WaveletPattern, rows: int, cols: int) -> Float[np.ndarray, "rows cols"]:
    """Zero-mean noise of unit standard deviation: `bands` octaves of equal power, float64."""
    total = np.zeros((rows, cols))
    for band in _bands(pattern, rows, cols):
        noise = band.part(slice(None), slice(None))
        # A band coarser than the whole pattern is nearly constant there, and adds nothing.
        total += noise / max(float(noise.std()), _LEAST_STD)
    return (total - total.mean()) / max(float(total.std()), _LEAST_STD)


def wavelet_parts(
    pattern: WaveletPattern, rows: int, cols: int
) -> Callable[[slice, slice], Float[np.ndarray, "_ _"]]:
    """The same noise by rectangles (rows, columns), to 1e-9: what is kept is the coefficients alone.

    Mean and deviation are those of the whole, gathered in strips once.
    """
    bands = list(_bands(pattern, rows, cols))
    mean, product = _moments(bands, rows, cols)
    std = np.maximum(np.sqrt(np.maximum(np.diag(product) - mean**2, 0.0)), _LEAST_STD)
    middle = float((mean / std).sum())
    spread = float((product / np.outer(std, std)).sum()) - middle**2
    scale = max(np.sqrt(max(spread, 0.0)), _LEAST_STD)

    def part(row: slice, col: slice) -> Float[np.ndarray, "_ _"]:
        total = sum(band.part(row, col) / one for band, one in zip(bands, std, strict=True))
        return np.asarray((total - middle) / scale)

    return part


def _moments(bands: list[_Band], rows: int, cols: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean of each band, and of each product of two."""
    mean, product = np.zeros(len(bands)), np.zeros((len(bands), len(bands)))
    strip = max(1, _STRIP_PIXELS // cols)
    for first in range(0, rows, strip):
        strips = [band.part(slice(first, first + strip), slice(None)).ravel() for band in bands]
        mean += [values.sum() for values in strips]
        product += [[one @ other for other in strips] for one in strips]
    return mean / (rows * cols), product / (rows * cols)


def _bands(pattern: WaveletPattern, rows: int, cols: int) -> Iterator[_Band]:
    for number in range(pattern.bands):
        # The band ends at half a cycle a spacing, so its finest period is two spacings.
        spacing_px = pattern.finest_px / 2 * 2**number
        yield _band(np.random.default_rng([pattern.seed, number]), rows, cols, spacing_px)


def _band(rng: np.random.Generator, rows: int, cols: int, spacing_px: float) -> _Band:
    shape = tuple(_coefficients(pixels, spacing_px) for pixels in (rows, cols))
    white = rng.standard_normal(shape)
    coarse = white
    for axis in (0, 1):
        coarse = _up(_down(coarse, axis), axis)
    return _Band(white - coarse, *(_spline_weights(n, spacing_px) for n in (rows, cols)))


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
