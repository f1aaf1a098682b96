"""Windows whose shift air cannot have, for all solvers: it stands alone in the picture.

The refractivity of air is smooth, so the shift that it causes is continuous over the picture. Between where the
pattern hardly moved and where it moved most it takes every value on the way. A thing that moved, and an edge or a
light that the picture's check took for the pattern, moved as a whole: no window near it shows half as much.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import KDTree

from core.drift import nearly_still
from core.problem import ShiftMeasurement

# Near a window are so many: a square of seven, with it in the middle.
_NEAR = 49
# Noise hides a step of so many deviations.
_SIGMAS = 6.0
# A window with more noise than this has no texture, and its shift means nothing.
_TEXTURED_PX = 1.0


def moved_as_air(
    shift: ShiftMeasurement, through_air: Bool[np.ndarray, " windows"]
) -> Bool[np.ndarray, " windows"]:
    """Windows whose shift is usual, or is reached from the usual over windows near each other.

    A step to a larger shift is at most half of that shift, and noise. Windows that are not seen `through_air` are not
    judged, and tell nothing of the others: where the air ends, so does its shift. Nor is one without texture. The
    camera's unknown motion is taken out first.
    """
    still = nearly_still(shift)
    noise_px = np.sqrt(np.trace(np.linalg.inv(still.information_per_px2), axis1=1, axis2=2))
    joined = (noise_px > _TEXTURED_PX) | ~through_air
    seen = np.flatnonzero(~joined)
    if len(seen) > 1:
        joined[seen] = _reached(still.centres_px[seen], still.displacement_px[seen], noise_px[seen])
    return joined


def left_out(moved: Sequence[Bool[np.ndarray, " _"]]) -> tuple[str, ...]:
    """A sentence on the windows that did not move as air does, each view's by `moved_as_air`; none without any."""
    alone, total = sum(int((~view).sum()) for view in moved), sum(len(view) for view in moved)
    if alone == 0:
        return ()
    return (
        f"{alone} of {total} windows ({100 * alone / total:.2g} %) show a shift that no air has: none near them "
        "shows half of it. They are left out; something there moved.",
    )


def _reached(
    centres_px: Float[np.ndarray, "windows 2"],
    shifts_px: Float[np.ndarray, "windows 2"],
    noise_px: Float[np.ndarray, " windows"],
) -> Bool[np.ndarray, " windows"]:
    size = np.linalg.norm(shifts_px, axis=1)
    usual = float(np.sqrt(np.mean(np.minimum(size, np.percentile(size, 90)) ** 2)))
    found = size <= usual + _SIGMAS * noise_px
    far = np.flatnonzero(~found)
    if len(far) == 0:
        return found
    _, near = KDTree(centres_px).query(centres_px[far], min(_NEAR, len(size)))
    apart = np.linalg.norm(shifts_px[far, None] - shifts_px[near], axis=2)
    noise = np.hypot(noise_px[far, None], noise_px[near])
    step = apart <= 0.5 * size[far, None] + _SIGMAS * noise
    while True:
        new = (step & found[near]).any(axis=1) & ~found[far]
        if not new.any():
            return found
        found[far[new]] = True
