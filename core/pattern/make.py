"""A pattern by its description: what to print, or to show on the projector."""

import numpy as np
from jaxtyping import Float32

from core.pattern.checkerboard import checkerboard
from core.pattern.dots import random_dots
from core.pattern.wavelet import wavelet_noise
from core.scene import DotPattern, Pattern, WaveletPattern
from core.setting import SettingError


def make_pattern(pattern: Pattern, rows: int, cols: int) -> Float32[np.ndarray, "rows cols"]:
    """Luminance from 0 to 1, exactly reproducible from the description.

    Wavelet noise has mean 1/2 and rms `contrast` before it is clipped. Raises SettingError for a size or
    a feature below one pixel.
    """
    if rows < 2 or cols < 2:
        raise SettingError(f"A pattern of {cols} x {rows} px was asked for; expected at least 2 x 2 px.")
    match pattern:
        case WaveletPattern():
            _check("finest_px", pattern.finest_px, 2.0)
            luminance = 0.5 + pattern.contrast * wavelet_noise(pattern, rows, cols)
        case DotPattern():
            _check("diameter_px", pattern.diameter_px, 1.0)
            luminance = 1.0 - random_dots(pattern, rows, cols)
        case _:
            _check("square_px", pattern.square_px, 1.0)
            luminance = checkerboard(pattern, rows, cols)
    return np.clip(luminance, 0.0, 1.0).astype(np.float32)


def _check(name: str, value_px: float, least_px: float) -> None:
    if value_px < least_px:
        raise SettingError(
            f"Pattern has {name} = {value_px:g}; a pattern pixel cannot show less than {least_px:g}. "
            f"Raise {name}."
        )
