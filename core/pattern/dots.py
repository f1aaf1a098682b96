"""Random dark dots on white, the classical background of schlieren by displacement."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

from core.scene import DotPattern

_EDGE_SAMPLES = 5


def random_dots(pattern: DotPattern, rows: int, cols: int) -> Float[np.ndarray, "rows cols"]:
    """Ink: 1 in a dot, 0 outside, anti-aliased at the rim. Dots fall independently and may overlap.

    For a coverage c the number of dots is -ln(1 - c) / dot area per pixel, so that overlaps are paid for.
    """
    return dot_parts(pattern, rows, cols)(slice(0, rows), slice(0, cols))


def dot_parts(
    pattern: DotPattern, rows: int, cols: int
) -> Callable[[slice, slice], Float[np.ndarray, "_ _"]]:
    """The same ink by rectangles (rows, columns): what is kept is the dots' places."""
    rng = np.random.default_rng(pattern.seed)
    margin = int(np.ceil(pattern.diameter_px)) + 1
    shape = (rows + 2 * margin, cols + 2 * margin)
    area_px2 = np.pi / 4 * pattern.diameter_px**2
    count = round(-np.log1p(-pattern.coverage) / area_px2 * shape[0] * shape[1])
    places = (rng.random((2, count)) * np.array(shape)[:, None]).astype(int)

    def part(row: slice, col: slice) -> Float[np.ndarray, "_ _"]:
        return _ink(places, pattern.diameter_px, margin, (row, col))

    return part


def _ink(
    places: Int[np.ndarray, "2 dots"], diameter_px: float, margin: int, window: tuple[slice, slice]
) -> Float[np.ndarray, "_ _"]:
    # Imported here: it takes a second, at every start of the service and of every command.
    from scipy.signal import oaconvolve

    # Places are counted from a margin before the pattern, so that a window begins at its own margin.
    first = np.array([[one.start] for one in window])
    size = np.array([one.stop - one.start + 2 * margin for one in window])
    local = places - first
    local = local[:, ((local >= 0) & (local < size[:, None])).all(axis=0)]
    centres = np.zeros(size)
    np.add.at(centres, tuple(local), 1.0)
    ink = np.clip(oaconvolve(centres, _disc(diameter_px), mode="same"), 0.0, 1.0)
    return ink[margin:-margin, margin:-margin]


def _disc(diameter_px: float) -> Float[np.ndarray, "size size"]:
    """Area of each pixel inside a disc, by supersampling."""
    half = int(np.ceil(diameter_px / 2))
    fine = (np.arange((2 * half + 1) * _EDGE_SAMPLES) + 0.5) / _EDGE_SAMPLES - (half + 0.5)
    inside = (fine[:, None] ** 2 + fine[None] ** 2 <= diameter_px**2 / 4).astype(float)
    size = 2 * half + 1
    return inside.reshape(size, _EDGE_SAMPLES, size, _EDGE_SAMPLES).mean((1, 3))
