"""One window of two pictures: least squares for its shift, free of what noise and lamps do to it.

    I_flow - I_ref = -d . grad I + (a + b . x + x . C x) I + c + noise,        I = (I_ref + I_flow) / 2

The gain may vary over the window to second order (a, b, C): a lamp that ripples looks like a shift otherwise. C is
as small as a ripple is expected to be, so that small windows lose little by it. The picture's gradient carries noise
of its own, of known variance s^2 |taps|^2 / 4 a pixel, which is taken out of the normal matrix: dim pictures would
show shifts too small (Fuller, Measurement Error Models, 1987, section 1.2). What is left beyond the noise (a chi-
squared above 1) counts as noise: the information is divided by it (Birge's ratio). A window whose own pixels are as
even as noise shows nothing: its slopes reach in from beyond it, and the difference of 0 would say that it is still.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy import ndimage

# Rows of a window's matrix of products: d column, d row; gain, its two slopes and three second orders, offset; the
# pictures' difference.
_SHIFT, _NUISANCE, _DIFFERENCE = slice(0, 2), slice(2, 9), 9
# A window without texture tells nothing: its displacement is 0 with this much information.
_LEAST_INFORMATION_PER_PX2 = 1e-6
# One sigma of the light's curvature: a ripple of 1 % with a period of 60 px.
_CURVATURE_PER_PX2 = 1e-4
# A texture and its gradient must stand so many deviations above those of noise.
_SEEN = 4.0
# The mean of both pictures has this share of their difference's variance.
_OF_MEAN = 0.25


class WindowFit(eqx.Module):
    """What windows say: shift (column, row), its information, chi-squared a degree of freedom, the pattern's gain.

    `gain` is the brightness of the pattern in the flow picture over that in the reference: about 1, and about 0
    where the pattern is not there. `contrast` is the pattern's variance over that of the noise.
    """

    displacement_px: Float[np.ndarray, "windows 2"]
    information_per_px2: Float[np.ndarray, "windows 2 2"]
    chi_squared: Float[np.ndarray, " windows"]
    gain: Float[np.ndarray, " windows"]
    contrast: Float[np.ndarray, " windows"]


def derivative_filter(half_taps: int = 10, highest_cycles_per_px: float = 0.4) -> Float[np.ndarray, " taps"]:
    """Antisymmetric taps c_k, sum 2 c_k sin(k w) = w: least squares of the relative error up to the limit.

    Within 0.1 % below 0.4 cycles a pixel. Central differences attenuate the gradient of a fine pattern
    (18 % at a period of 3 px, order 8), and the displacement grows by as much.
    """
    omega = np.linspace(1e-3, 2 * np.pi * highest_cycles_per_px, 400)
    sines = 2 * np.sin(np.outer(omega, np.arange(1, half_taps + 1))) / omega[:, None]
    half = np.linalg.lstsq(sines, np.ones_like(omega), rcond=None)[0]
    return np.concatenate([-half[::-1], [0.0], half])


def gradients(image: Float[np.ndarray, "*batch rows cols"]) -> tuple[np.ndarray, np.ndarray]:
    """Slope along columns and along rows, per px; edges are repeated."""
    return gradient(image, -1), gradient(image, -2)


def gradient(
    image: Float[np.ndarray, "*batch rows cols"], axis: int
) -> Float[np.ndarray, "*batch rows cols"]:
    """Slope along one axis, per px; edges are repeated."""
    return ndimage.correlate1d(image, derivative_filter(), axis=axis, mode="nearest")


def window_products(
    slopes: tuple[Float[np.ndarray, "windows px px"], Float[np.ndarray, "windows px px"]],
    mean: Float[np.ndarray, "windows px px"],
    difference: Float[np.ndarray, "windows px px"],
) -> Float[np.ndarray, "windows 10 10"]:
    """Sums over a window of the products of its ten pictures: the sufficient statistics of the fit."""
    windows, px, _ = mean.shape
    x = (np.arange(px) - (px - 1) / 2) / px
    y = x[:, None]
    pictures = np.empty((windows, 10, px, px))
    pictures[:, 0], pictures[:, 1], pictures[:, 2] = slopes[0], slopes[1], mean
    for n, shape in enumerate((x, y, x * x, x * y, y * y), 3):
        pictures[:, n] = mean * shape
    pictures[:, 8], pictures[:, 9] = 1.0, difference
    flat = pictures.reshape(windows, 10, px * px)
    return flat @ flat.transpose(0, 2, 1)


def fit_windows(
    products: Float[np.ndarray, "windows 10 10"], variance: Float[np.ndarray, " windows"], pixels: int
) -> WindowFit:
    """The fit of every window of `pixels`; `variance` is that of a pixel of the difference."""
    products = products / variance[:, None, None]
    nuisance = products[:, _NUISANCE, _NUISANCE] + np.diag(_known_of_gain(pixels))
    scale = 1 / np.sqrt(np.maximum(np.diagonal(nuisance, axis1=1, axis2=2), 1e-30))
    scaled = nuisance * scale[:, :, None] * scale[:, None] + 1e-9 * np.eye(nuisance.shape[-1])
    sides = np.concatenate(
        [products[:, _NUISANCE, _SHIFT], products[:, _NUISANCE, _DIFFERENCE, None]], axis=2
    )
    solved = np.linalg.solve(scaled, sides * scale[:, :, None]) * scale[:, :, None]
    cross = products[:, _SHIFT, _NUISANCE]
    normal = products[:, _SHIFT, _SHIFT] - cross @ solved[..., :2]
    score = products[:, _SHIFT, _DIFFERENCE] - (cross @ solved[..., 2:])[..., 0]
    left = products[:, _DIFFERENCE, _DIFFERENCE] - np.einsum(
        "wk,wk->w", products[:, _NUISANCE, _DIFFERENCE], solved[..., 2]
    )
    shift, information, noise = _without_noise(normal, score, pixels)
    residual = (
        left + 2 * np.einsum("wi,wi->w", shift, score) + np.einsum("wi,wij,wj->w", shift, normal, shift)
    )
    freedom = max(pixels - products.shape[-1] + 1, 1)
    chi_squared = np.maximum(residual - noise * np.sum(shift**2, axis=1), 0.0) / freedom
    contrast = np.maximum(products[:, 2, 2] - products[:, 2, 8] ** 2 / products[:, 8, 8], 0.0) / pixels
    shows = contrast > _OF_MEAN * (1.0 + _SEEN * np.sqrt(2 / pixels))
    information = information * (shows / np.maximum(chi_squared, 1.0))[:, None, None]
    gain = solved[:, 0, 2] + np.einsum("wi,wi->w", solved[:, 0, :2], shift)
    return WindowFit(
        shift * shows[:, None],
        information + _LEAST_INFORMATION_PER_PX2 * np.eye(2),
        chi_squared,
        gain=(2 + gain) / (2 - gain),
        contrast=contrast,
    )


def _known_of_gain(pixels: int) -> Float[np.ndarray, " nuisances"]:
    """What is known beforehand of each nuisance (1 / variance): of the gain's second order alone."""
    # Coordinates are in windows: a square term is half of the curvature.
    square = (0.5 * _CURVATURE_PER_PX2 * pixels) ** -2
    return np.array([0.0, 0.0, 0.0, square, 0.25 * square, square, 0.0])


def _without_noise(
    normal: Float[np.ndarray, "windows 2 2"], score: Float[np.ndarray, "windows 2"], pixels: int
) -> tuple[Float[np.ndarray, "windows 2"], Float[np.ndarray, "windows 2 2"], float]:
    """Shift and information with the gradient's own noise out of the normal matrix, and that noise's share."""
    noise = _OF_MEAN * pixels * float(np.sum(derivative_filter() ** 2))
    strength, axes = np.linalg.eigh(normal)
    texture = strength - noise
    seen = texture > _SEEN * noise * np.sqrt(2 / pixels)
    inverse = np.where(seen, 1 / np.where(seen, texture, 1.0), 0.0)
    shift = -np.einsum("wij,wj,wkj,wk->wi", axes, inverse, axes, score)
    known = np.where(seen, texture**2 / np.maximum(strength, 1e-30), 0.0)
    return shift, np.einsum("wij,wj,wkj->wik", axes, known, axes), noise
