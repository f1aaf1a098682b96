"""A checkerboard."""

import numpy as np
from jaxtyping import Float

from core.scene import CheckerPattern


def checkerboard(pattern: CheckerPattern, rows: slice, cols: slice) -> Float[np.ndarray, "rows cols"]:
    """1 and 0 in squares of `square_px`, of these rows and columns; the pattern's first square is 0."""
    row, col = (np.floor(np.arange(one.start, one.stop) / pattern.square_px) for one in (rows, cols))
    return (row[:, None] + col[None]) % 2
