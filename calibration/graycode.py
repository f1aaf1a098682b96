"""Gray code: patterns for a projector, and which projector pixel lights each camera pixel.

Order as in OpenCV's structured light: columns from the coarsest bit to the finest, then rows, each bit
as it is and inverted; at the end white and black. Cost of decoding: about 0.3 s for 42 frames of
1280 x 1024.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped, UInt8

from calibration.errors import ImageError
from core.pattern.gray import gray_code

# White over black must exceed this many standard deviations of a frame: a wrong coarse bit is far off.
NOISE_FACTOR = 12.0


@dataclass(frozen=True)
class Decoded:
    """Projector pixel (column, row) by camera pixel, and how sure each is.

    `confidence` is the smallest bit contrast over the white-black contrast of the pixel: near 1 inside
    a stripe, near 0 on a stripe's edge (where the code is off by one at most) or without light. `lit`
    marks pixels whose white-black contrast stands out and whose code lies on the panel.
    """

    column_px: Int[np.ndarray, "rows cols"]
    row_px: Int[np.ndarray, "rows cols"]
    confidence: Float[np.ndarray, "rows cols"]
    contrast: Float[np.ndarray, "rows cols"]
    lit: Bool[np.ndarray, "rows cols"]
    off_panel: float


def bits_for(size_px: int) -> int:
    """Bits that number `size_px` columns or rows."""
    return max(1, int(np.ceil(np.log2(size_px))))


def frame_count(width_px: int, height_px: int) -> int:
    """Frames in one sequence: two a bit, white, black."""
    return 2 * (bits_for(width_px) + bits_for(height_px)) + 2


def patterns(width_px: int, height_px: int) -> UInt8[np.ndarray, "frames height width"]:
    """The frames to show, in order, white and black last."""
    white = np.full((1, height_px, width_px), 255, np.uint8)
    return np.concatenate([gray_code(height_px, width_px), white, np.zeros_like(white)])


def decode(
    frames: Shaped[np.ndarray, "frames rows cols"],
    width_px: int,
    height_px: int,
    *,
    threshold: float = 0.04,
    full_scale: int | None = None,
) -> Decoded:
    """Decode one sequence; `threshold` is the least white-black contrast over the full scale used.

    Raises:
        ImageError: a wrong number of frames for this panel.
    """
    expected = frame_count(width_px, height_px)
    if len(frames) != expected:
        raise ImageError(
            f"{len(frames)} Gray-code frames; a projector of {width_px} x {height_px} px needs {expected} "
            f"({bits_for(width_px)} + {bits_for(height_px)} bits, each with its inverse, then white and "
            "black). Retake the sequence, or correct --projector-px."
        )
    contrast = frames[-2].astype(np.float32) - frames[-1].astype(np.float32)
    scale = full_scale if full_scale is not None else max(float(np.percentile(contrast, 99.5)), 1.0)
    lit = contrast > max(threshold * scale, NOISE_FACTOR * _noise(frames))
    split = 2 * bits_for(width_px)
    column, sure_column = _number(frames[:split], contrast)
    row, sure_row = _number(frames[split:-2], contrast)
    on_panel = (column < width_px) & (row < height_px)
    confidence = np.where(lit, np.minimum(sure_column, sure_row), 0.0)
    off = float(np.mean(~on_panel[lit])) if lit.any() else 0.0
    return Decoded(column, row, confidence, contrast, lit & on_panel, off)


def _noise(frames: np.ndarray) -> float:
    """Standard deviation of one frame: a pattern and its inverse add up to white and black."""
    some = frames[:, ::4, ::4].astype(np.float32)
    excess = some[:-2:2] + some[1:-2:2] - (some[-2] + some[-1])
    return float(np.median(np.abs(excess - np.median(excess)))) * 1.4826 / 2.0


def _number(frames: np.ndarray, contrast: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The number that the bit pairs spell, and the smallest relative bit contrast."""
    number = np.zeros(contrast.shape, np.int64)
    sure = np.full(contrast.shape, np.inf, np.float32)
    bit = np.zeros(contrast.shape, np.int64)
    for normal, inverse in zip(frames[::2], frames[1::2], strict=True):
        difference = normal.astype(np.float32) - inverse.astype(np.float32)
        # Gray to binary: each bit is the exclusive or of all coarser Gray bits and its own.
        bit ^= (difference > 0).astype(np.int64)
        number = 2 * number + bit
        np.minimum(sure, np.abs(difference), out=sure)
    return number, np.clip(sure / np.maximum(contrast, 1e-6), 0.0, 1.0)
