"""The variance of a picture: from the camera's noise model, or from the scatter of the frames themselves."""

import numpy as np
from jaxtyping import Float32
from scipy.special import gammaincinv

from core.scene import CameraNoise

Image = Float32[np.ndarray, "rows cols"]


# Groups of pixels of about one brightness.
_LEVELS = 32


def frame_variance(image: Image, noise: CameraNoise) -> Image:
    """Variance of one frame's pixel, in parts of full scale squared: shot, read and digitisation noise.

    Source: EMVA 1288, the linear camera model.
    """
    full_scale = 2**noise.bits - 1
    per_e = (full_scale - noise.dark_counts) / noise.full_well_e
    electrons = np.maximum(image * full_scale - noise.dark_counts, 0) / per_e
    variance = (electrons + noise.read_noise_e**2) * (per_e / full_scale) ** 2 + 1 / 12 / full_scale**2
    return variance.astype(np.float32)


def scattered_variance(mean: Image, std: Image, frames: int, flicker: float, step: float) -> Image:
    """Variance of one frame's pixel as a straight line in its brightness (photon transfer), from `frames` frames.

    `mean` and `std` of one frame are parts of full scale. `flicker` is the relative scatter of the frames' levels,
    which is the light's and not a pixel's; `step` is one count. The line goes through medians over pixels of about
    one brightness, so that what moves before the wall hardly counts. Source: Janesick (2007).
    """
    # The median of a chi-squared is less than its mean.
    typical = 2.0 * gammaincinv(0.5 * (frames - 1), 0.5) / (frames - 1)
    order = np.argsort(mean, axis=None)
    level, variance = (
        np.array([np.median(part) for part in np.array_split(values.ravel()[order], _LEVELS)])
        for values in (mean, std.astype(np.float64) ** 2)
    )
    variance = variance / typical - (flicker * level) ** 2
    slope, offset = np.polyfit(level, variance, 1) if np.ptp(level) > 0 else (0.0, float(variance.mean()))
    return np.maximum(slope * mean + offset, step**2 / 12).astype(np.float32)
