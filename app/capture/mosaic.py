"""Is this picture the raw mosaic of a colour sensor? Its colours stand still on the sensor, whatever the air does."""

import numpy as np
from jaxtyping import Float32

from drivers.verdict import Verdict

# Of a tile's mean. Twice that makes a shift too small by 0.4 % where the pattern's rms contrast is 0.24.
MAX_DIFFERENCE = 0.02
# A whole number of the periods 2, 3, 4, 6, 8 and 12 px, so that these do not count.
TILE_PX = 24
LEAST_TILES = 16


def judge_mosaic(mean: Float32[np.ndarray, "rows cols"]) -> tuple[Verdict, ...]:
    """Return the verdict on pixels that differ by the parity of their row and column; none where they do not.

    A mosaic's four kinds of pixels differ alike in every tile. A pattern does so only where a part of it has a period
    of exactly two pixels, in step with the sensor from edge to edge: else its tiles differ in all ways, and their
    median is near zero. What three deviations of that median leave open is no difference. Of a picture with fewer
    than 16 tiles nothing is said.
    """
    rows, columns = (n // TILE_PX for n in mean.shape)
    half = TILE_PX // 2
    tiles = mean[: rows * TILE_PX, : columns * TILE_PX].reshape(rows, half, 2, columns, half, 2)
    kinds = tiles.mean(axis=(1, 4), dtype=np.float64).transpose(0, 2, 1, 3).reshape(-1, 4)
    kinds = kinds[kinds.min(axis=1) > 0]
    if len(kinds) < LEAST_TILES:
        return ()
    parts = kinds / kinds.mean(axis=1, keepdims=True)
    middle = np.median(parts, axis=0)
    # Of a normal distribution: 1.48 median deviations are one standard deviation, 1.25 of it that of a median.
    scatter = 1.48 * np.median(np.abs(parts - middle), axis=0).max()
    difference = float(np.ptp(middle))
    if difference - 3 * 1.25 * scatter * (2 / len(parts)) ** 0.5 <= MAX_DIFFERENCE:
        return ()
    return (
        Verdict(
            "mosaic",
            False,
            difference,
            f"pixels of even and odd rows and columns alike to {MAX_DIFFERENCE:g}",
            "This looks like the raw mosaic of a colour sensor. It does not move with the air: shifts are found too "
            "small. Develop the camera's raw files (linear, 16 bits), or keep the pixels of one colour alone.",
        ),
    )
