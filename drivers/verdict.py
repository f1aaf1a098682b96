"""Is this burst fit to measure with? Each verdict has a value, what was expected, and what to do."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32

TILE_PX = 512
MAX_SATURATED = 1e-4
LEVEL = (0.15, 0.85)
MAX_DARK = 0.1
MIN_CONTRAST = 0.03
FEATURE_PX = (3.0, 24.0)
MAX_FLICKER = 0.002
MAX_BEAT = 0.02
WARM_UP_S = 1800.0


@dataclass(frozen=True)
class Verdict:
    """One judgement: `value` against `expected` in words; `advice` says what to do when it is not `good`."""

    name: str
    good: bool
    value: float
    expected: str
    advice: str


def judge_images(
    mean: Float32[np.ndarray, "rows cols"], std: Float32[np.ndarray, "rows cols"], frames: int
) -> tuple[Verdict, ...]:
    """Return verdicts on level, contrast, focus and temporal noise of a pattern's burst.

    `mean` and `std` (of one frame) are parts of full scale.
    Measured on up to nine tiles spread over the image, corrected for the noise that is left in the mean.
    """
    tiles = [(mean[at], std[at]) for at in _tiles(mean.shape)]
    level = float(np.median([tile.mean() for tile, _ in tiles]))
    contrasts, features = zip(*(_texture(tile, noise, frames) for tile, noise in tiles), strict=True)
    noise = float(np.median([spread.mean() for _, spread in tiles]))
    return (
        _judge_level(level),
        Verdict(
            "contrast",
            float(np.median(contrasts)) >= MIN_CONTRAST,
            float(np.median(contrasts)),
            f"rms contrast of the pattern at least {MIN_CONTRAST:g}",
            "Darken the room, raise the projector's brightness, or show a pattern of more contrast.",
        ),
        _judge_focus(float(np.median(features))),
        Verdict(
            "temporal noise",
            noise <= 0.1 * max(level, 1e-9),
            noise / max(level, 1e-9),
            "standard deviation of one frame below 10 % of the level",
            "Give more light or less gain; look for mains lamps and moving shadows.",
        ),
    )


def judge_dark(mean: Float32[np.ndarray, "rows cols"]) -> Verdict:
    """Return the verdict on dark frames: nothing but the camera's own level may be in them."""
    level = float(mean.mean())
    return Verdict(
        "dark level",
        level <= MAX_DARK,
        level,
        f"mean at most {MAX_DARK:g} of full scale",
        "Cover the lens, and switch the projector's picture off.",
    )


def judge_level(mean: Float32[np.ndarray, "rows cols"]) -> Verdict:
    """Return the verdict on the exposure of flat frames."""
    return _judge_level(float(mean.mean()))


def judge_saturation(saturated: Sequence[float], exposure_s: float | None) -> Verdict:
    """Return the verdict on saturated pixels: the largest part of any frame counts."""
    worst = max(saturated, default=0.0)
    now = "" if exposure_s is None else f" of {exposure_s:g} s"
    return Verdict(
        "saturation",
        worst <= MAX_SATURATED,
        worst,
        f"at most {MAX_SATURATED:g} of the pixels at full scale, or piled up on the highest count",
        f"Shorten the exposure{now} or close the aperture; a saturated pixel has no shift.",
    )


def judge_flicker(levels: Sequence[float]) -> Verdict:
    """Return the verdict on the whole image's brightness from frame to frame."""
    flicker = float(np.std(levels) / np.mean(levels)) if len(levels) > 1 and np.mean(levels) > 0 else 0.0
    return Verdict(
        "flicker",
        flicker <= MAX_FLICKER,
        flicker,
        f"brightness steady to {MAX_FLICKER:g} of itself",
        "Set the exposure to a whole number of projector periods; switch dynamic iris and mains lamps off.",
    )


def judge_beat(exposure_s: float, refresh_hz: float) -> Verdict:
    """Return the verdict on exposure against the projector's refresh: whole periods do not beat."""
    periods = exposure_s * refresh_hz
    off = abs(periods - round(periods)) if periods >= 0.5 else 1.0
    nearest_s = max(1, round(periods)) / refresh_hz
    return Verdict(
        "refresh beat",
        off <= MAX_BEAT,
        periods,
        f"a whole number of periods of {refresh_hz:g} Hz",
        f"Set the exposure to {nearest_s:.6f} s: a projector draws its greys over one whole period.",
    )


def judge_warm_up(on_s: float) -> Verdict:
    """Return the verdict on how long the rig has been on."""
    return Verdict(
        "warm-up",
        on_s >= WARM_UP_S,
        on_s,
        f"on for at least {WARM_UP_S:g} s",
        f"Wait {max(0.0, WARM_UP_S - on_s):.0f} s more: lamps and lenses move while they warm up.",
    )


def judge_refused(refused: int, frames: int) -> Verdict:
    """Return the verdict on the frames that had to be refused."""
    part = refused / max(refused + frames, 1)
    return Verdict(
        "refused frames",
        part <= 0.1,
        part,
        "at most a tenth of the frames refused",
        "Use another USB port or a shorter cable, lower the frame rate, close other programs.",
    )


def _judge_level(level: float) -> Verdict:
    return Verdict(
        "level",
        LEVEL[0] <= level <= LEVEL[1],
        level,
        f"mean between {LEVEL[0]:g} and {LEVEL[1]:g} of full scale",
        "Lengthen the exposure or open the aperture." if level < LEVEL[0] else "Shorten the exposure.",
    )


def _judge_focus(feature_px: float) -> Verdict:
    fine = feature_px < FEATURE_PX[0]
    return Verdict(
        "focus",
        FEATURE_PX[0] <= feature_px <= FEATURE_PX[1],
        feature_px,
        f"features of {FEATURE_PX[0]:g} to {FEATURE_PX[1]:g} pixels a period",
        "The pattern is finer than the camera can sample: choose a coarser one."
        if fine
        else "Focus camera and projector, or choose a finer pattern.",
    )


def _tiles(shape: tuple[int, ...]) -> list[tuple[slice, slice]]:
    def starts(length: int) -> list[int]:
        last = max(length - TILE_PX, 0)
        return sorted({0, last // 2, last})

    return [np.s_[r : r + TILE_PX, c : c + TILE_PX] for r in starts(shape[0]) for c in starts(shape[1])]


def _texture(tile: np.ndarray, std: np.ndarray, frames: int) -> tuple[float, float]:
    """Return rms contrast and feature period [px] of one tile, the mean's own noise taken off.

    A sinusoid of period P has rms slope 2 pi / P of its rms value. Central differences halve noise variance.
    """
    noise_var = float(np.mean(std.astype(np.float64) ** 2)) / max(frames, 1)
    texture = tile - cv2.blur(tile, (65, 65))
    variance = max(float(texture.var()) - noise_var, 0.0)
    slope_var = sum(max(float(cv2.filter2D(texture, -1, k).var()) - noise_var / 2, 0.0) for k in _SLOPES)
    contrast = variance**0.5 / max(float(tile.mean()), 1e-9)
    return contrast, 2 * np.pi * (variance / max(slope_var, 1e-18)) ** 0.5


_SLOPES = (np.array([[-0.5, 0.0, 0.5]], np.float32), np.array([[-0.5], [0.0], [0.5]], np.float32))
