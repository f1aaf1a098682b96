"""Which windows does something stand before? Where the reference does not show the pattern that the scene states.

A thing that stands still is in both pictures and shows no shift: the pair of them cannot tell. The reference, beside
what the scene would show, can. A block of windows is covered if its correlation with the rendered pattern is far
below that of the picture's other blocks.
"""

import numpy as np
from jaxtyping import Bool, Float, Float32

from core.displacement import window_centres
from core.rays.visibility import sees_wall
from core.render import pixel_renderer
from core.scene import Scene

# Pixels compared in each block: evenly spaced.
_ACROSS = 10
# A block is wide enough for many features of the finest pattern.
_BLOCK_PX = 24
# Blocks scatter; a covered one is so many deviations below the median (by Fisher's z).
_SIGMAS = 4.0
# Below this median the scene's pattern is not what the camera sees, and nothing can be said of single windows.
_LEAST_CORRELATION = 0.3


def covered_windows(
    scene: Scene, view: int, reference: Float32[np.ndarray, "rows cols"], window_px: int
) -> Bool[np.ndarray, " windows"]:
    """For each whole window of the picture, whether something stands before the wall there."""
    block_px = window_px * -(-_BLOCK_PX // window_px)
    centres = window_centres(reference.shape, block_px)
    chosen = sees_wall(scene, view, centres, margin_px=0.5 * block_px)
    windows = window_centres(reference.shape, window_px)
    if chosen.sum() < 3:
        return np.zeros(len(windows), bool)
    correlation = _correlations(scene, view, reference, centres[chosen], block_px)
    z = np.arctanh(np.clip(correlation, -0.999, 0.999))
    usual = float(np.median(z))
    if np.tanh(usual) < _LEAST_CORRELATION:
        return np.zeros(len(windows), bool)
    scatter = max(1.4826 * float(np.median(np.abs(z - usual))), (_ACROSS**2 - 3) ** -0.5)
    covered = np.zeros(len(centres), bool)
    covered[chosen] = z < usual - _SIGMAS * scatter
    rows, columns = (n // block_px for n in reference.shape)
    row, column = (
        np.minimum(windows[:, a] // block_px, n - 1).astype(int) for a, n in ((1, rows), (0, columns))
    )
    return covered.reshape(rows, columns)[row, column]


def _correlations(
    scene: Scene,
    view: int,
    picture: Float32[np.ndarray, "rows cols"],
    centres_px: Float[np.ndarray, "blocks 2"],
    block_px: int,
) -> Float[np.ndarray, " blocks"]:
    """Of the picture with the rendered pattern, over evenly spaced pixels of each block."""
    steps = np.unique(np.linspace(0, block_px - 1, _ACROSS).round()) - (block_px - 1) / 2
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    pixels = np.rint((centres_px[:, None, :] + offsets).reshape(-1, 2))
    rendered = np.asarray(pixel_renderer(scene, view, pixels).reference(), float)
    seen = picture[pixels[:, 1].astype(int), pixels[:, 0].astype(int)].astype(float)
    pair = [values.reshape(len(centres_px), -1) for values in (rendered, seen)]
    a, b = (values - values.mean(1, keepdims=True) for values in pair)
    size = np.sqrt((a**2).sum(1) * (b**2).sum(1))
    return (a * b).sum(1) / np.maximum(size, 1e-30)
