"""Windows that moved far: the reference is moved to where the flow picture is, until nothing is left to move.

A shift beyond a tenth of a pixel is no longer linear in the picture. Each such window is fitted again against the
reference moved by what was found, by a quintic spline; one that no small shift explains starts from the best whole
pixel of a normalised cross-correlation (Scarano, Iterative image deformation methods in PIV, 2002).
"""

from functools import partial

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage

from core.window_fit import WindowFit, derivative_filter, fit_windows, gradient, window_products

# The spline's own error in a texture with a period of five pixels is below 1e-3 px.
_SPLINE_ORDER = 5
_PASSES, _STILL_PX = 8, 0.02
# So many windows are held in memory at once.
_BATCH = 512


class WindowSearch:
    """The pair of pictures, ready to fit windows of `window_px` anywhere in it."""

    def __init__(
        self,
        reference_image: Float[np.ndarray, "rows cols"],
        flow_image: Float[np.ndarray, "rows cols"],
        window_px: int,
    ) -> None:
        self._reference, self._flow, self.window_px = reference_image, flow_image, window_px
        self._spline = ndimage.spline_filter(reference_image, order=_SPLINE_ORDER).astype(np.float32)
        self._margin = len(derivative_filter()) // 2

    def follow(
        self,
        first_px: Int[np.ndarray, "windows 2"],
        start_px: Float[np.ndarray, "windows 2"],
        variance: Float[np.ndarray, " windows"],
    ) -> WindowFit:
        """Fit the windows whose first pixels (column, row) are given, from a first guess of their shifts."""
        parts = [
            self._follow(first_px[n : n + _BATCH], start_px[n : n + _BATCH], variance[n : n + _BATCH])
            for n in range(0, len(first_px), _BATCH)
        ]
        return jax.tree.map(lambda *of: np.concatenate(of), *parts)

    def whole_pixels(
        self, first_px: Int[np.ndarray, "windows 2"], reach_px: int
    ) -> Float[np.ndarray, "windows 2"]:
        """The shift by whole pixels, up to `reach_px`, of the highest normalised cross-correlation."""
        parts = [
            self._whole_pixels(first_px[n : n + _BATCH], reach_px) for n in range(0, len(first_px), _BATCH)
        ]
        return np.concatenate(parts)

    def _follow(self, first_px: np.ndarray, start_px: np.ndarray, variance: np.ndarray) -> WindowFit:
        margin = self._margin
        there = _patches(self._flow, first_px - margin, self.window_px + 2 * margin)
        at_px, moving = start_px.copy(), np.ones(len(first_px), bool)
        found = self._fit(there, first_px, at_px, variance)
        for _ in range(_PASSES):
            step = np.clip(found.displacement_px[moving], -1.0, 1.0)
            at_px[moving] += step
            moving[moving] = np.abs(step).max(axis=1) > _STILL_PX
            if not moving.any():
                break
            new = self._fit(there[moving], first_px[moving], at_px[moving], variance[moving])
            found = jax.tree.map(partial(_put, where=moving), found, new)
        return eqx.tree_at(lambda fit: fit.displacement_px, found, at_px)

    def _fit(
        self, there: np.ndarray, first_px: np.ndarray, at_px: np.ndarray, variance: np.ndarray
    ) -> WindowFit:
        px, margin = self.window_px, self._margin
        moved = self._moved(first_px - at_px - margin, px + 2 * margin)
        mean = 0.5 * (moved + there)
        inside = slice(margin, margin + px)
        inner = (slice(None), inside, inside)
        # A slope along one axis needs no margin along the other.
        slopes = gradient(mean[:, inside], -1)[..., inside], gradient(mean[..., inside], -2)[:, inside]
        products = window_products(slopes, mean[inner], (there - moved)[inner])
        return fit_windows(products, variance, px * px)

    def _moved(self, first_px: Float[np.ndarray, "windows 2"], size: int) -> np.ndarray:
        """Squares of the reference between its pixels, from `first_px` (column, row) on; each moves as a whole.

        So the spline's weights are the same in all rows of a square, and in all its columns. Beyond the picture's
        edge the last pixel is repeated.
        """
        whole = np.floor(first_px).astype(int)
        taps = _spline_taps((first_px - whole).astype(np.float64))
        reach = size + _SPLINE_ORDER
        near = _patches(self._spline, whole - _SPLINE_ORDER // 2, reach)
        down = _weighted(near, taps[:, 1], -2, size)
        return _weighted(down, taps[:, 0], -1, size)

    def _whole_pixels(self, first_px: np.ndarray, reach_px: int) -> np.ndarray:
        px, wide = self.window_px, self.window_px + 2 * reach_px
        there = _patches(self._flow, first_px, px).astype(np.float64)
        there -= there.mean(axis=(1, 2), keepdims=True)
        around = _patches(self._reference, first_px - reach_px, wide).astype(np.float64)
        around -= around.mean(axis=(1, 2), keepdims=True)
        spectrum = np.fft.rfft2(around) * np.conj(np.fft.rfft2(there, s=(wide, wide)))
        both = np.fft.irfft2(spectrum, s=(wide, wide))[:, : 2 * reach_px + 1, : 2 * reach_px + 1]
        energy = _boxes(around**2, px) - _boxes(around, px) ** 2 / px**2
        alike = both / np.sqrt(np.maximum(energy, 1e-12 * np.maximum(energy.max(), 1e-30)))
        row, column = np.unravel_index(alike.reshape(len(alike), -1).argmax(axis=1), alike.shape[1:])
        # The flow picture at x shows the reference at x - d.
        return reach_px - np.stack([column, row], axis=1).astype(float)


def _spline_taps(fraction: Float[np.ndarray, "windows 2"]) -> Float[np.ndarray, "windows 2 6"]:
    """Weights of the six coefficients about a place: the quintic B-spline at their distances from it."""
    t = np.abs(np.arange(-2, 4) - fraction[..., None])
    near = (66 - 60 * t**2 + 30 * t**4 - 10 * t**5) / 120
    further = (51 + 75 * t - 210 * t**2 + 150 * t**3 - 45 * t**4 + 5 * t**5) / 120
    return np.where(t < 1, near, np.where(t < 2, further, np.maximum(3 - t, 0.0) ** 5 / 120))


def _weighted(
    patches: Float[np.ndarray, "windows rows cols"],
    taps: Float[np.ndarray, "windows 6"],
    axis: int,
    size: int,
) -> Float[np.ndarray, "windows _ _"]:
    """Sums of `size` neighbours along an axis, with each window's own weights."""
    along = np.moveaxis(patches, axis, 1)
    weights = taps.astype(patches.dtype)[..., None, None]
    total = weights[:, 0] * along[:, :size]
    for n in range(1, taps.shape[1]):
        total += weights[:, n] * along[:, n : n + size]
    return np.moveaxis(total, 1, axis)


def _put(old: np.ndarray, new: np.ndarray, where: Bool[np.ndarray, " windows"]) -> np.ndarray:
    """`old` with the windows `where` replaced by `new`."""
    both = old.copy()
    both[where] = new
    return both


def _patches(
    image: Float[np.ndarray, "rows cols"], first_px: Int[np.ndarray, "windows 2"], size: int
) -> Float[np.ndarray, "windows size size"]:
    """Squares of the picture from `first_px` (column, row) on; beyond its edge the last pixel is repeated."""
    rows = np.clip(first_px[:, 1, None] + np.arange(size), 0, image.shape[0] - 1)
    columns = np.clip(first_px[:, 0, None] + np.arange(size), 0, image.shape[1] - 1)
    return image[rows[:, :, None], columns[:, None, :]]


def _boxes(image: Float[np.ndarray, "windows wide wide"], px: int) -> Float[np.ndarray, "windows n n"]:
    """Sums over every square of `px` in each patch."""
    total = np.pad(image.cumsum(axis=1).cumsum(axis=2), ((0, 0), (1, 0), (1, 0)))
    return total[:, px:, px:] - total[:, :-px, px:] - total[:, px:, :-px] + total[:, :-px, :-px]
