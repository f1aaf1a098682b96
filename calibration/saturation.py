"""Where a camera's counts end: at full scale, or below it where pixels pile up on one count."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped

# Pixels that may share the highest count by chance, and how much more than a count below it a pile-up holds.
_CHANCE = 10
_PILED = 3
# Counts below the highest one that it is held against.
_BELOW = 5
# Light of fewer counts may have less noise than one count: then an even picture is a pile-up.
_LEAST_COUNTS = 64
# Of a picture; of a larger one only every so many pixels are counted.
_ENOUGH_PIXELS = 4_000_000


def saturated_from(pictures: Sequence[Shaped[np.ndarray, "..."]], full_scale: int) -> int:
    """The count from which on pixels of these pictures of one camera are saturated.

    That is below full scale where 12 bits stand at the top of 16 (65520), in video's limited range (235), and on
    sensors that clip early. There far more pixels have the highest count than any of the counts next below, whereas
    the tail of what light and noise spread thins out. Pictures of one count, and means of frames, which are no whole
    numbers, tell nothing.
    """
    held = np.zeros(2**16, np.int64)
    for counts in pictures:
        if counts.dtype not in (np.uint8, np.uint16):
            return full_scale
        held += np.bincount(counts.ravel()[:: counts.size // _ENOUGH_PIXELS + 1], minlength=len(held))
    seen = np.flatnonzero(held)
    if len(seen) < 2 or not _LEAST_COUNTS <= seen[-1] < full_scale:
        return full_scale
    piled = held[seen[-1]] > max(_CHANCE, _PILED * held[seen[-1 - _BELOW : -1]].max())
    return int(seen[-1]) if piled else full_scale
