"""Which windows does something stand before? Where the reference does not show the pattern that the scene states.

A thing that stands still is in both pictures and shows no shift: the pair of them cannot tell. The reference, beside
what the scene would show, can. A block of a few windows that shows nothing of the rendered pattern is covered, with
every window in it; so is a window beside it that lacks a good part of the pattern. Where single windows show their
pattern plainly, each is a block of its own: a thing may be narrower than several.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32
from scipy import ndimage

from core.displacement import window_centres
from core.rays.visibility import sees_wall
from core.render import pixel_renderer
from core.scene import Scene
from core.window_fit import derivative_filter

# Pixels compared in each window: evenly spaced.
_ACROSS = 10
# A block is wide enough for many features of the finest pattern.
_BLOCK_PX = 24
# Blocks scatter; a covered one is so many deviations below the median (by Fisher's z).
_SIGMAS = 4.0
# Below this median the scene's pattern is not what the camera sees, and nothing can be said of single windows.
_LEAST_CORRELATION = 0.3
# Beside a covered block a window is left out that lacks more of its pattern than this: its shift would be as wrong.
_MISSING = 0.25


@dataclass(frozen=True)
class _Likeness:
    """How the picture goes with the rendered pattern: Fisher's z, and how much of the pattern is in it."""

    z: Float[np.ndarray, "rows columns"]
    gain: Float[np.ndarray, "rows columns"]


def covered_windows(
    scene: Scene, view: int, reference: Float32[np.ndarray, "rows cols"], window_px: int
) -> Bool[np.ndarray, " windows"]:
    """For each whole window of the picture, whether something unstated stands before the wall."""
    centres = window_centres(reference.shape, window_px)
    rows, columns = (n // window_px for n in reference.shape)
    tested = sees_wall(scene, view, centres, margin_px=0.5 * window_px)
    if tested.sum() < 3:
        return np.zeros(len(centres), bool)
    sums = np.zeros((6, len(centres)))
    sums[:, tested] = _sums(scene, view, reference, centres[tested], window_px)
    on_wall, sums = tested.reshape(rows, columns), sums.reshape(6, rows, columns)
    covered = np.zeros_like(on_wall)
    for across in {1, _windows_across(window_px)}:
        covered |= _without_pattern(sums, on_wall, across)
    return ((covered | _partly(sums, on_wall, covered)) & on_wall).ravel()


def reached_from(
    covered: Bool[np.ndarray, " windows"], shape: tuple[int, int], window_px: int
) -> Bool[np.ndarray, " windows"]:
    """The covered windows of a picture of `shape`, and those whose gradient reaches into one of them."""
    across = 2 * -(-(len(derivative_filter()) // 2) // window_px) + 1
    grid = covered.reshape([n // window_px for n in shape])
    return np.asarray(ndimage.binary_dilation(grid, np.ones((across, across))), bool).ravel()


def _windows_across(window_px: int) -> int:
    """How many windows a block is wide: odd, so that it has a middle one."""
    return 1 if window_px >= _BLOCK_PX else 2 * (-(-_BLOCK_PX // window_px) // 2) + 1


def _without_pattern(
    sums: Float[np.ndarray, "6 rows columns"], on_wall: Bool[np.ndarray, "rows columns"], across: int
) -> Bool[np.ndarray, "rows columns"]:
    """Windows in a block, so many windows wide, that shows nothing of the pattern."""
    square = np.ones((across, across))
    block = _likeness(np.stack([ndimage.correlate(one, square, mode="constant") for one in sums]))
    usual, usual_gain = (float(np.median(values[on_wall])) for values in (block.z, block.gain))
    if np.tanh(usual) < _LEAST_CORRELATION:
        return np.zeros_like(on_wall)
    scatter = 1.4826 * float(np.median(np.abs(block.z[on_wall] - usual)))
    unlike = block.z < usual - _SIGMAS * max(scatter, (_ACROSS**2 - 3) ** -0.5)
    # Half of what one free column of windows in the block would show.
    bare = on_wall & unlike & (block.gain < usual_gain / (2 * across))
    return np.asarray(ndimage.binary_dilation(bare, square), bool)


def _partly(
    sums: Float[np.ndarray, "6 rows columns"],
    on_wall: Bool[np.ndarray, "rows columns"],
    covered: Bool[np.ndarray, "rows columns"],
) -> Bool[np.ndarray, "rows columns"]:
    """Windows beside covered ones that lack a part of their pattern."""
    beside, gain = np.asarray(ndimage.binary_dilation(covered, np.ones((3, 3))), bool), _likeness(sums).gain
    return beside & (gain < (1.0 - _MISSING) * float(np.median(gain[on_wall])))


def _likeness(sums: Float[np.ndarray, "6 rows columns"]) -> _Likeness:
    """From the sums of 1, a, b, aa, bb and ab: a rendered, b seen."""
    count, a, b, aa, bb, ab = sums
    count = np.maximum(count, 1.0)
    together, own, seen = ab - a * b / count, aa - a**2 / count, bb - b**2 / count
    correlation = together / np.sqrt(np.maximum(own * seen, 1e-30))
    return _Likeness(np.arctanh(np.clip(correlation, -0.999, 0.999)), together / np.maximum(own, 1e-30))


def _sums(
    scene: Scene,
    view: int,
    picture: Float32[np.ndarray, "rows cols"],
    centres_px: Float[np.ndarray, "windows 2"],
    window_px: int,
) -> Float[np.ndarray, "6 windows"]:
    """Of 1, a, b, aa, bb and ab over evenly spaced pixels of each window: a as the scene renders it, b as seen."""
    steps = np.unique(np.linspace(0, window_px - 1, _ACROSS).round()) - (window_px - 1) / 2
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    pixels = np.rint((centres_px[:, None, :] + offsets).reshape(-1, 2))
    rendered = np.asarray(pixel_renderer(scene, view, pixels).reference(), float)
    seen = picture[pixels[:, 1].astype(int), pixels[:, 0].astype(int)].astype(float)
    a, b = (values.reshape(len(centres_px), -1) for values in (rendered, seen))
    return np.stack([one.sum(axis=1) for one in (np.ones_like(a), a, b, a * a, b * b, a * b)])
