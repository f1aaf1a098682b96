"""Small luminance views for the simulated camera."""

import cv2
import numpy as np


def pattern(rows: int = 96, cols: int = 128, *, level: float = 0.5, contrast: float = 0.2, seed: int = 0):
    """Return band-limited noise with a period of about 8 px."""
    noise = np.random.default_rng(seed).normal(size=(rows, cols)).astype(np.float32)
    texture = cv2.GaussianBlur(noise, (0, 0), 1.0) - cv2.GaussianBlur(noise, (0, 0), 2.0)
    return (level * (1 + contrast * texture / texture.std())).astype(np.float32)
