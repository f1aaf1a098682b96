"""Running mean and variance of a burst, exact, in the memory of two images whatever the number of frames.

Counts are whole numbers, and float64 holds sums of squares of 16-bit counts exactly up to two million
frames: plain sums therefore lose nothing, and no update formula is needed.
"""

import cv2
import numpy as np
from jaxtyping import Float32

from drivers.protocols import Pixels

ROWS_AT_ONCE = 256


class RunningMoments:
    """Sums over frames of one shape. `frames` counts them."""

    def __init__(self) -> None:
        self.frames = 0
        self._sum = self._squares = np.zeros((0, 0))

    def add(self, pixels: Pixels) -> None:
        """Take one more frame in. Raises ValueError when its shape differs from the first one's."""
        if self.frames == 0:
            self._sum, self._squares = np.zeros(pixels.shape), np.zeros(pixels.shape)
        if pixels.shape != self._sum.shape:
            raise ValueError(
                f"A frame of shape {pixels.shape} came into a burst of shape {self._sum.shape}. "
                "The camera changed its format: take the burst again."
            )
        cv2.accumulate(pixels, self._sum)
        cv2.accumulateSquare(pixels, self._squares)
        self.frames += 1

    def mean(self, full_scale_counts: int) -> Float32[np.ndarray, "rows cols"]:
        """Return the mean over frames, in parts of full scale."""
        return (self._sum * (1.0 / (max(self.frames, 1) * full_scale_counts))).astype(np.float32)

    def std(self, full_scale_counts: int) -> Float32[np.ndarray, "rows cols"]:
        """Return the standard deviation of one frame (n - 1), in parts of full scale; 0 for one frame."""
        out = np.zeros(self._sum.shape, np.float32)
        if self.frames < 2:
            return out
        for row in range(0, len(out), ROWS_AT_ONCE):
            rows = slice(row, row + ROWS_AT_ONCE)
            spread = self._squares[rows] - self._sum[rows] ** 2 / self.frames
            np.clip(spread, 0.0, None, out=spread)
            out[rows] = np.sqrt(spread / (self.frames - 1)) / full_scale_counts
        return out
