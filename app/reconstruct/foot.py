"""The foot of a thing, below the wall: what the camera sees there is not stated, but a floor looks alike all along.

Row by row, the mean and the finest contrast of pieces in the thing's columns are compared with those of as wide
pieces of the same row beside it. The thing ends where the rows stop to look different.
"""

import numpy as np
from jaxtyping import Bool, Float, Float32

# Pieces of a row scatter; a thing's is so many deviations (by the median, over all rows) away from them.
_SIGMAS = 4.0
# Pieces are wide enough for a few features; so many tell how a row scatters.
_PIECE_PX, _LEAST_PIECES = 24, 4
# Pieces do not scatter less, whatever the median says: noise alone does by as much of full scale.
_LEAST_SCATTER = 1e-3
# A blurred edge is so many rows wide: a foot nearer to the wall's edge is none, one nearer to the picture's is below.
_LEAST_ROWS = 3


def foot_row(
    picture: Float32[np.ndarray, "rows cols"],
    first_row: int,
    columns: slice,
    free: Bool[np.ndarray, " cols"],
) -> int | None:
    """The last row that a thing in `columns` is seen in, from `first_row` down; `free` columns show no thing.

    The picture's last row if the thing goes on to it; None where nothing is seen below, or too little beside it.
    """
    width = min(columns.stop - columns.start, _PIECE_PX)
    pieces = _pieces(free, width)
    if len(pieces) < _LEAST_PIECES or first_row >= len(picture):
        return None
    inside = np.zeros_like(free)
    inside[columns] = True
    below = picture[first_row:]
    own = np.median(_look(below, _pieces(inside, width)), axis=2)
    beside = _look(below, pieces)
    usual = np.median(beside, axis=2)
    scatter = 1.4826 * np.median(np.abs(beside - usual[:, :, None]), axis=(1, 2))
    far = np.abs(own - usual) > _SIGMAS * np.maximum(scatter, _LEAST_SCATTER)[:, None]
    unlike = far.any(axis=0)
    # Single rows are like the floor, or unlike it, by chance: the split that the fewest rows contradict.
    score = np.cumsum(np.where(unlike, 1, -1))
    if score.max() < _LEAST_ROWS:
        return None
    last = first_row + int(score.argmax())
    return len(picture) - 1 if last + _LEAST_ROWS >= len(picture) - 1 else last


def _pieces(free: Bool[np.ndarray, " cols"], width: int) -> list[slice]:
    """Free runs of columns, cut into pieces of this width."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(int)))
    return [
        slice(first, first + width)
        for start, stop in zip(edges[::2], edges[1::2], strict=True)
        for first in range(start, stop - width + 1, width)
    ]


def _look(rows: Float32[np.ndarray, "rows cols"], pieces: list[slice]) -> Float[np.ndarray, "2 rows pieces"]:
    """Of each piece of each row: its mean, and the logarithm of the rms step from pixel to pixel."""
    cut = np.stack([rows[:, piece] for piece in pieces], axis=1).astype(float)
    step = np.sqrt((np.diff(cut, axis=2) ** 2).mean(axis=2))
    return np.stack([cut.mean(axis=2), np.log(np.maximum(step, _LEAST_SCATTER))])
