"""The air as far as a solver has come, drawn with coloured blocks in a terminal."""

import numpy as np
from rich.color import Color
from rich.style import Style
from rich.text import Text

from core.comfort import CELSIUS_K
from core.result import Solution

# Blue over white to red, as people think of cold and warm.
_STOPS = np.array([[49, 54, 149], [116, 173, 209], [247, 247, 247], [253, 174, 97], [165, 0, 38]], float)
COLUMNS, LINES = 56, 14


def sketch(solution: Solution, columns: int = COLUMNS, lines: int = LINES) -> Text:
    """The temperature on the middle plane, x to the right and z upwards; two rows of it in each line."""
    temperature_k = solution.filled().temperature_k
    middle = temperature_k[:, temperature_k.shape[1] // 2]
    across = np.linspace(0, middle.shape[0] - 1, columns).round().astype(int)
    up = np.linspace(middle.shape[1] - 1, 0, 2 * lines).round().astype(int)
    plane = middle[np.ix_(across, up)].T
    low, high = np.percentile(plane, [1, 99])
    share = np.clip((plane - low) / max(high - low, 1e-6), 0.0, 1.0) * (len(_STOPS) - 1)
    below = np.minimum(share.astype(int), len(_STOPS) - 2)
    part = (share - below)[..., None]
    colours = (_STOPS[below] * (1 - part) + _STOPS[below + 1] * part).astype(int)
    drawn = Text()
    for n in range(lines):
        for upper, lower in zip(colours[2 * n], colours[2 * n + 1], strict=True):
            drawn.append("▀", Style(color=Color.from_rgb(*upper), bgcolor=Color.from_rgb(*lower)))
        drawn.append("\n")
    drawn.append(
        f"middle of the room, {low - CELSIUS_K:.1f} °C (blue) to {high - CELSIUS_K:.1f} °C (red)", "dim"
    )
    return drawn
