"""A checkerboard."""

import numpy as np
from jaxtyping import Float

from core.scene import CheckerPattern


def checkerboard(pattern: CheckerPattern, rows: int, cols: int) -> Float[np.ndarray, "rows cols"]:
    """1 and 0 in squares of `square_px`; the first square is 0."""
    row, col = (np.floor(np.arange(n) / pattern.square_px) for n in (rows, cols))
    return (row[:, None] + col[None]) % 2
