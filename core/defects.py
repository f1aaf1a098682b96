"""Pixels of the sensor that show nothing of the scene: hot ones, dead ones.

A lens spreads every point over more than a pixel, so a pixel lies little above or below its eight neighbours: in a
texture whose finest period is 5 px by at most 1.6 times as far as they lie apart (two such waves along the
diagonals), in noise hardly ever by more. A defect stands out further. It does not move when the camera does: on a
bare wall a few of them would tell that the camera stood still.
"""

import numpy as np
from jaxtyping import Bool, Float32

Image = Float32[np.ndarray, "rows cols"]

# A defect lies further above, or below, all of its neighbours than so many times their range.
_STANDS_OUT = 3.0
_NEIGHBOURS = [(row, column) for row in (0, 1, 2) for column in (0, 1, 2) if (row, column) != (1, 1)]


def without_defects(image: Image) -> Image:
    """The picture with each defect replaced by the median of its neighbours; the picture itself if it has none.

    The outermost pixels are left as they are.
    """
    where = np.argwhere(defects(image))
    if not len(where):
        return image
    repaired = image.copy()
    rows, columns = (where + 1).T
    around = np.stack([image[rows + r - 1, columns + c - 1] for r, c in _NEIGHBOURS])
    repaired[rows, columns] = np.median(around, axis=0)
    return repaired


def defects(image: Image) -> Bool[np.ndarray, "inner_rows inner_cols"]:
    """Which pixels, without the outermost, are defects."""
    height, width = image.shape
    if height < 3 or width < 3:
        return np.zeros((max(height - 2, 0), max(width - 2, 0)), bool)
    low, high = (np.full((height - 2, width - 2), start, image.dtype) for start in (np.inf, -np.inf))
    for row, column in _NEIGHBOURS:
        neighbour = image[row : row + height - 2, column : column + width - 2]
        np.minimum(low, neighbour, out=low)
        np.maximum(high, neighbour, out=high)
    inner, apart = image[1:-1, 1:-1], _STANDS_OUT * (high - low)
    return (inner - high > apart) | (low - inner > apart)
