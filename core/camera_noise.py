"""The variance of a picture, from the camera's noise model."""

import numpy as np
from jaxtyping import Float32

from core.scene import CameraNoise

Image = Float32[np.ndarray, "rows cols"]


def frame_variance(image: Image, noise: CameraNoise) -> Image:
    """Variance of one frame's pixel, in parts of full scale squared: shot, read and digitisation noise.

    Source: EMVA 1288, the linear camera model.
    """
    full_scale = 2**noise.bits - 1
    per_e = (full_scale - noise.dark_counts) / noise.full_well_e
    electrons = np.maximum(image * full_scale - noise.dark_counts, 0) / per_e
    variance = (electrons + noise.read_noise_e**2) * (per_e / full_scale) ** 2 + 1 / 12 / full_scale**2
    return variance.astype(np.float32)
