"""What the operator sees of a raw frame: numbers, and a JPEG for the eyes; never measured from."""

from dataclasses import dataclass

import cv2
import numpy as np

from drivers.protocols import Frame, Pixels
from drivers.saturation import saturated_share

BINS = 64
JPEG_QUALITY = 80


@dataclass(frozen=True)
class Statistics:
    """Of the raw counts, as fractions of full scale.

    `sharpness_nd` is the Laplacian's standard deviation over the mean: it grows towards focus.
    """

    mean: float
    saturated: float
    dark: float
    sharpness_nd: float
    histogram: tuple[int, ...]


@dataclass(frozen=True)
class LiveFrame:
    """One frame ready to be shown; `number` counts what this camera has shown since it was opened."""

    number: int
    timestamp_s: float
    statistics: Statistics
    jpegs: dict[bool, bytes]
    rows: int
    cols: int


def statistics_of(frame: Frame) -> Statistics:
    """Return the statistics of every second pixel along each axis (sharpness: of the central part)."""
    counts = frame.pixels[::2, ::2]
    full = frame.full_scale_counts
    # Shifting is several times faster than dividing, and a camera's full scale is one below a power of two.
    shift = max(0, int(full + 1).bit_length() - 1 - 6)
    histogram = np.bincount((counts >> shift).ravel(), minlength=BINS)[:BINS]
    mean_counts = float(counts.mean())
    return Statistics(
        mean=mean_counts / full,
        saturated=saturated_share(frame, every=2),
        dark=float(np.count_nonzero(counts == 0)) / counts.size,
        sharpness_nd=_sharpness(frame.pixels, mean_counts),
        histogram=tuple(int(n) for n in histogram),
    )


def jpeg_of(frame: Frame, stretch: bool) -> bytes:
    """Return an 8-bit JPEG; with `stretch`, the span from the 1st to the 99th percentile fills it."""
    full = frame.full_scale_counts
    low, high = _span(frame.pixels, full) if stretch else (0.0, float(full))
    scale = 255.0 / max(high - low, 1.0)
    shown = cv2.convertScaleAbs(np.maximum(frame.pixels, int(low)), alpha=scale, beta=-int(low) * scale)
    done, encoded = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes() if done else b""


def _span(pixels: Pixels, full: int) -> tuple[float, float]:
    low, high = np.percentile(pixels[::4, ::4], (1.0, 99.0))
    return float(low), float(max(high, low + 0.01 * full))


def _sharpness(pixels: Pixels, mean_counts: float) -> float:
    rows, cols = pixels.shape
    height, width = min(rows, 512), min(cols, 512)
    top, left = (rows - height) // 2, (cols - width) // 2
    part = pixels[top : top + height, left : left + width].astype(np.float32)
    return float(cv2.Laplacian(part, cv2.CV_32F).std()) / max(mean_counts, 1.0)
