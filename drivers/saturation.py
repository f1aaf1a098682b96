"""How much of a frame is saturated, also where the camera's counts end below the format's full scale."""

import numpy as np

from drivers.protocols import Frame, Pixels

# A pile-up holds at least so many pixels: fewer may share a frame's highest count by chance.
LEAST_PIXELS = 10
# Below this count light's own noise may be less than a count, and any even frame is a pile-up.
LEAST_COUNTS = 64
# What is just below the highest count: this part of it, at least one count.
BELOW = 1 / 128


def saturated_share(frame: Frame, every: int = 1) -> float:
    """Return the part of the pixels at full scale, or piled up on the frame's highest count.

    Counts end below full scale where 12 bits stand at the top of 16 (65520), in video's limited range (235), and on
    sensors that clip early. Then more pixels share the highest count than have the counts just below it. A frame
    in which every pixel has one count tells nothing. Only every so many pixels along each axis are looked at.
    """
    pixels = frame.pixels[::every, ::every]
    end = min(int(pixels.max(initial=0)), frame.full_scale_counts)
    at_end = int(np.count_nonzero(pixels >= end))
    if end < frame.full_scale_counts and not _is_pile(pixels, end, at_end):
        return 0.0
    return at_end / pixels.size


def _is_pile(pixels: Pixels, highest: int, at_highest: int) -> bool:
    if highest < LEAST_COUNTS or at_highest < LEAST_PIXELS:
        return False
    lowest = highest - max(1, int(BELOW * highest))
    just_below = int(np.count_nonzero(pixels >= lowest)) - at_highest
    return 0 < just_below < at_highest
