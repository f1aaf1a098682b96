"""A pattern by its description: what to print, or to show on the projector."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float32

from core.pattern.checkerboard import checkerboard
from core.pattern.dots import dot_parts, random_dots
from core.pattern.wavelet import wavelet_noise, wavelet_parts
from core.scene import DotPattern, Pattern, WaveletPattern
from core.setting import SettingError, check_range

# Four times the largest panel; as float64 it fills 2 GB.
_MOST_PIXELS = 2.0**28
_TOO_FINE = "A pattern pixel cannot show less, nor a wall much more."


def make_pattern(pattern: Pattern, rows: int, cols: int) -> Float32[np.ndarray, "rows cols"]:
    """Luminance from 0 to 1, exactly reproducible from the description.

    Wavelet noise has mean 1/2 and rms `contrast` before it is clipped. Raises SettingError for a size or
    a feature below one pixel.
    """
    _check_size(rows, cols)
    check_pattern(pattern)
    match pattern:
        case WaveletPattern():
            luminance = 0.5 + pattern.contrast * wavelet_noise(pattern, rows, cols)
        case DotPattern():
            luminance = 1.0 - random_dots(pattern, rows, cols)
        case _:
            luminance = checkerboard(pattern, slice(0, rows), slice(0, cols))
    return np.clip(luminance, 0.0, 1.0).astype(np.float32)


def pattern_parts(
    pattern: Pattern, rows: int, cols: int
) -> Callable[[slice, slice], Float32[np.ndarray, "_ _"]]:
    """The same pattern, of `rows` x `cols`, a rectangle (rows, columns) at a time, to 1e-6: for sheets of paper.

    Slices have both ends. A rectangle takes the memory of its own size. Raises SettingError as `make_pattern` does.
    """
    _check_size(rows, cols)
    check_pattern(pattern)
    match pattern:
        case WaveletPattern():
            noise = wavelet_parts(pattern, rows, cols)

            def luminance(row: slice, col: slice) -> np.ndarray:
                return 0.5 + pattern.contrast * noise(row, col)
        case DotPattern():
            ink = dot_parts(pattern, rows, cols)

            def luminance(row: slice, col: slice) -> np.ndarray:
                return 1.0 - ink(row, col)
        case _:

            def luminance(row: slice, col: slice) -> np.ndarray:
                return checkerboard(pattern, row, col)

    return lambda row, col: np.clip(luminance(row, col), 0.0, 1.0).astype(np.float32)


def _check_size(rows: int, cols: int) -> None:
    if rows < 2 or cols < 2 or rows * cols > _MOST_PIXELS:
        raise SettingError(
            f"A pattern of {cols} x {rows} px was asked for; expected at least 2 x 2 px and at most "
            f"{_MOST_PIXELS:g} in all. Check pixel_m (a print) or the projector's panel."
        )


def check_pattern(pattern: Pattern) -> None:
    """Refuse a pattern that cannot be made. Raises SettingError."""
    match pattern:
        case WaveletPattern():
            check_range("finest_px", pattern.finest_px, 2.0, 1e4, "pattern pixels", _TOO_FINE)
            check_range("bands", pattern.bands, 1, 12, "", "Four octaves serve most cameras.")
            check_range("contrast", pattern.contrast, 0.0, 10.0, "", "It is the rms about 1/2: 0.2 is usual.")
        case DotPattern():
            check_range("diameter_px", pattern.diameter_px, 1.0, 1e3, "pattern pixels", _TOO_FINE)
            check_range("coverage", pattern.coverage, 0.0, 0.99, "", "It is the inked share of the wall.")
        case _:
            check_range("square_px", pattern.square_px, 1.0, 1e6, "pattern pixels", _TOO_FINE)
