"""Gray code: stripes that name every projector column and row, one bit an image."""

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8


def gray_code(rows: int, cols: int) -> UInt8[np.ndarray, "images rows cols"]:
    """Images 0 / 255: the column's bits, the most significant first, then the row's; each with its inverse.

    Neighbouring stripes differ in one image only, so a blurred edge costs at most one pixel.
    """
    images = []
    for count, axis in ((cols, 1), (rows, 0)):
        index = np.arange(count)
        code = index ^ (index >> 1)
        for bit in reversed(range(_bits(count))):
            line = ((code >> bit) & 1).astype(bool)
            image = np.broadcast_to(line[None] if axis == 1 else line[:, None], (rows, cols))
            images += [image, ~image]
    return np.stack(images).astype(np.uint8) * np.uint8(255)


def decode_gray(
    images: Float[np.ndarray, "images camera_rows camera_cols"], rows: int, cols: int
) -> tuple[Int[np.ndarray, "camera_rows camera_cols"], Int[np.ndarray, "camera_rows camera_cols"]]:
    """Projector (row, column) that each camera pixel saw, from `gray_code` images in order."""
    bits = images[0::2] > images[1::2]
    split = _bits(cols)
    return _binary(bits[split : split + _bits(rows)]), _binary(bits[:split])


def _binary(bits: Bool[np.ndarray, "bits r c"]) -> Int[np.ndarray, "r c"]:
    running = np.zeros(bits.shape[1:], bool)
    value = np.zeros(bits.shape[1:], int)
    for bit in bits:
        running = running ^ bit
        value = value * 2 + running
    return value


def _bits(count: int) -> int:
    return max(1, int(np.ceil(np.log2(count))))
