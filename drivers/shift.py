"""Move an image by a fraction of a pixel, as a camera does that warms up between two exposures."""

import cv2
import numpy as np
from jaxtyping import Float32

_HALF_TAPS = 8


def shift_image(
    image: Float32[np.ndarray, "rows cols"], shift_px: tuple[float, float]
) -> Float32[np.ndarray, "rows cols"]:
    """Return `image` moved by `shift_px` = (columns, rows) to the right and down; edges are mirrored.

    A windowed sinc of 16 taps at the exact fraction. OpenCV's own warps round it to 1/32 px, which is
    more than the shifts that are measured here.
    """
    kernels = [_kernel(value) for value in shift_px]
    return cv2.sepFilter2D(image, cv2.CV_32F, kernels[0], kernels[1], borderType=cv2.BORDER_REFLECT_101)


def _kernel(shift: float) -> np.ndarray:
    reach = _HALF_TAPS + int(np.ceil(abs(shift)))
    at = np.arange(-reach, reach + 1) + shift  # correlation: the output at x reads the input at x - shift
    window = np.where(np.abs(at) < _HALF_TAPS, np.cos(np.pi * at / (2 * _HALF_TAPS)) ** 2, 0.0)
    taps = np.sinc(at) * window
    return (taps / taps.sum()).astype(np.float32)
