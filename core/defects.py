"""Pixels of the sensor that show nothing of the scene: hot ones, dead ones.

A lens spreads every point over more than a pixel, so a pixel follows from those around it: the weights of the best
linear prediction (Wiener) are those of the picture itself. A defect does not follow, and its neighbours, predicted
with it, do not either. So a pixel is a defect where it alone makes more than half of all that is unpredicted around
it, and explains more of that than any pixel near it would. It does not move when the camera does: a few of them tell
that the camera stood still, on a bare wall and in a texture alike.

Of two defects side by side each predicts the other: they may be missed.
"""

import numpy as np
from jaxtyping import Bool, Float, Float32
from scipy import ndimage

Image = Float32[np.ndarray, "rows cols"]

# A pixel is predicted from those at most so far away in rows and columns: half a period of the finest pattern.
_REACH = 2
_AROUND = [(r, c) for r in range(2 * _REACH + 1) for c in range(2 * _REACH + 1) if (r, c) != (_REACH, _REACH)]
# Pixels that the weights are learned from: a thousand for each weight.
_LEARNED_FROM = 1000 * len(_AROUND)
# Pixels across the square in which what is unpredicted is summed: three predictions side by side.
_SQUARE = 3 * (2 * _REACH + 1)
_HALF = 0.5


def without_defects(image: Image) -> Image:
    """The picture with each defect replaced by its prediction; the picture itself if it has none.

    The two outermost rows and columns of pixels are left as they are.
    """
    if min(image.shape) <= 2 * _REACH:
        return image
    weights = _weights(image)
    inner, predicted = image[_REACH:-_REACH, _REACH:-_REACH], _predicted(image, weights)
    bad = _stands_alone(inner - predicted, weights)
    if not bad.any():
        return image
    repaired = image.copy()
    repaired[_REACH:-_REACH, _REACH:-_REACH][bad] = predicted[bad]
    return repaired


def _weights(image: Image) -> Float[np.ndarray, " around"]:
    """Of each pixel around, by least squares; they sum to 1, so that a bare wall is predicted as well."""
    rng, inner = np.random.default_rng(0), np.array(image.shape) - 2 * _REACH
    rows, columns = (rng.integers(0, n, _LEARNED_FROM) for n in inner)
    around = np.stack([image[rows + r, columns + c] for r, c in _AROUND], axis=1).astype(float)
    centre, mean = image[rows + _REACH, columns + _REACH].astype(float), around.mean(1)
    free, *_ = np.linalg.lstsq(around - mean[:, None], centre - mean, rcond=None)
    return free + (1.0 - free.sum()) / len(free)


def _predicted(
    image: Image, weights: Float[np.ndarray, " around"]
) -> Float32[np.ndarray, "inner_rows inner_cols"]:
    rows, columns = (n - 2 * _REACH for n in image.shape)
    total = np.zeros((rows, columns), np.float32)
    for (r, c), weight in zip(_AROUND, weights.astype(np.float32), strict=True):
        total += weight * image[r : r + rows, c : c + columns]
    return total


def _stands_alone(
    left: Float32[np.ndarray, "rows cols"], weights: Float[np.ndarray, " around"]
) -> Bool[np.ndarray, "rows cols"]:
    """Where a pixel, by itself and in the prediction of its neighbours, makes more than half of what is left.

    A defect leaves itself, and minus its weight in each prediction around it. A neighbour's weight may be
    above 1, and what is left is then largest beside the defect: the pixel is the one that explains most.
    """
    size = np.abs(left)
    around = ndimage.uniform_filter(size, _SQUARE, mode="constant") * _SQUARE**2
    alone = size * (1.0 + float(np.abs(weights).sum())) > _HALF * around
    rows, columns = np.nonzero(alone)
    explained = np.pad(np.abs(_left_as_by_one(left, weights)), _REACH)
    own = explained[rows + _REACH, columns + _REACH]
    nearby = [explained[rows + r, columns + c] for r, c in _AROUND]
    alone[rows, columns] = own > np.max(nearby, axis=0, initial=0.0)
    return alone


def _left_as_by_one(
    left: Float32[np.ndarray, "rows cols"], weights: Float[np.ndarray, " around"]
) -> Float32[np.ndarray, "rows cols"]:
    """How far what is left around each pixel is what a defect there leaves."""
    rows, columns = left.shape
    padded, total = np.pad(left, _REACH), left.copy()
    for (r, c), weight in zip(_AROUND, weights.astype(np.float32), strict=True):
        total -= weight * padded[2 * _REACH - r :, 2 * _REACH - c :][:rows, :columns]
    return total
