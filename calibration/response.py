"""Response and noise: dark frames, a grey ramp, photon transfer, flat field.

Photon transfer (Janesick 2007): the temporal variance of a linear sensor is
    variance = gain * signal + (gain * read_noise_e)^2 + 1/12        [counts^2]
with `signal` above the dark level and 1/12 from digitisation. Frame-to-frame changes of the whole
light (a lamp's flicker) are removed before, as they are no photon noise.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Shaped

from calibration.bundle import CameraResponse, ProjectorResponse, Quality
from calibration.errors import ImageError
from calibration.saturation import saturated_from
from calibration.views import SATURATED_FRACTION

# Sizes are checked here, by a message, and not by the types.
Burst = Shaped[np.ndarray, "_ _ _"]

_QUANTISATION = 1.0 / 12.0


@dataclass(frozen=True)
class LevelStatistics:
    """Mean and temporal variance of one light level [counts, counts^2], and the saturated fraction."""

    mean: float
    variance: float
    variance_std: float
    saturated: float


def measure_camera(
    name: str,
    dark: Burst,
    ramp: tuple[Burst, ...],
    bits: int,
    exposures_s: tuple[float, ...] | None = None,
) -> CameraResponse:
    """Gain, read noise, full well and linearity from dark frames and bursts of steady light.

    `exposures_s`, one a burst under the same light, give the linearity; without them the camera's
    curve is taken as straight, which photon transfer supports but does not prove.

    Raises:
        ImageError: fewer than two frames a burst, too few usable levels, mixed sizes.
    """
    _check(dark, ramp)
    limit = 2**bits - 1
    end = saturated_from(ramp, limit)
    darkness = level_statistics(dark, end)
    levels = [level_statistics(burst, end) for burst in ramp]
    usable = [s for s in levels if s.saturated < 1e-4 and s.mean > darkness.mean]
    if len(usable) < 3:
        raise ImageError(
            f"{len(usable)} of {len(levels)} levels are brighter than dark and not saturated; expected at "
            "least 3. Retake the ramp: shorten the exposure until the brightest level stays below "
            f"{end} counts."
        )
    gain, gain_std, read_counts = _photon_transfer(darkness, usable)
    curve, nonlinearity = _linearity(darkness, levels, exposures_s)
    return CameraResponse(
        name=name,
        bits=bits,
        dark_counts=darkness.mean,
        gain_counts_per_e=gain,
        read_noise_e=read_counts / gain,
        full_well_e=(limit - darkness.mean) / gain,
        linearity=curve,
        nonlinearity=nonlinearity,
        gain_std_counts_per_e=gain_std,
        read_noise_std_e=darkness.variance_std / max(2 * read_counts, 1e-9) / gain,
        quality=Quality("measured", views=len(levels), coverage=1.0, advice=_advice(levels, nonlinearity)),
    )


def level_statistics(burst: Burst, limit: int) -> LevelStatistics:
    """Mean, temporal variance without common flicker, and its standard deviation."""
    frames = burst.astype(np.float64)
    steady = frames - (frames.mean(axis=(1, 2), keepdims=True) - frames.mean())
    count = frames.shape[0]
    variance = float(steady.var(axis=0, ddof=1).mean())
    # A normal sample variance scatters by sqrt(2 / degrees of freedom).
    scatter = variance * np.sqrt(2.0 / max((count - 1) * frames[0].size, 1))
    saturated = float(np.mean(burst >= limit))
    return LevelStatistics(float(frames.mean()), variance, float(scatter), saturated)


def measure_projector(
    levels: tuple[float, ...], ramp: tuple[Burst, ...], dark_counts: float, bits: int
) -> ProjectorResponse:
    """Luminance (0..1 of white, black level included) by grey level, and the best exponent.

    Raises:
        ImageError: fewer than four levels, a ramp whose order is wrong, one that does not rise, or saturated white.
    """
    if len(levels) != len(ramp) or len(levels) < 4:
        raise ImageError(
            f"{len(ramp)} bursts for {len(levels)} grey levels; expected one each and at least 4 levels."
        )
    order = np.argsort(levels)
    grey = np.array(levels, float)[order]
    light = np.array([float(np.mean(ramp[i])) - dark_counts for i in order])
    if light[-1] <= 0 or (np.diff(light) < -0.01 * light[-1]).any():
        raise ImageError(
            "The grey ramp does not grow with its level; expected darker to brighter. Check the order of "
            "the frames, and that the projector's dynamic contrast and iris are off."
        )
    if light[-1] - light[0] < 0.01 * light[-1]:
        raise ImageError(
            f"The grey ramp goes from {light[0]:.0f} to {light[-1]:.0f} counts above dark; expected it to rise. "
            "Every level is saturated, or the projector's light does not reach the camera: shorten the exposure."
        )
    _check_white(ramp[order[-1]], saturated_from(ramp, 2**bits - 1))
    relative = light / light[-1]
    black = float(relative[0]) if grey[0] <= 0 else 0.0
    span = np.clip((relative - black) / (1 - black), 0, 1)
    return ProjectorResponse(
        levels=tuple(map(float, grey / max(grey[-1], 1e-9))),
        luminance=tuple(map(float, relative)),
        gamma=_gamma(grey / grey[-1], span),
        black_level=black,
    )


def flat_field(white: Burst, black: Burst, bits: int) -> Float32[np.ndarray, "rows cols"]:
    """Relative illumination and vignetting, its median one: (mean white - mean black) / median.

    Raises:
        ImageError: white is no brighter than black, or saturated.
    """
    _check_white(white, saturated_from((white, black), 2**bits - 1))
    lit = white.astype(np.float64).mean(axis=0) - black.astype(np.float64).mean(axis=0)
    middle = float(np.median(lit))
    if middle <= 0:
        raise ImageError("White is not brighter than black; the flat field needs both. Retake them.")
    return (lit / middle).astype(np.float32)


def _photon_transfer(dark: LevelStatistics, levels: list[LevelStatistics]) -> tuple[float, float, float]:
    """Gain [counts/e], its standard deviation, and the read noise [counts]."""
    everything = [dark, *levels]
    signal = np.array([s.mean - dark.mean for s in everything])
    variance = np.array([s.variance for s in everything]) - _QUANTISATION
    weight = 1.0 / np.array([max(s.variance_std, 1e-9) for s in everything])
    design = np.stack([signal, np.ones_like(signal)], axis=1) * weight[:, None]
    solution = np.linalg.lstsq(design, variance * weight, rcond=None)[0]
    covariance = np.linalg.inv(design.T @ design)
    gain = float(solution[0])
    if gain <= 0:
        raise ImageError(
            "The noise does not grow with the light, so the frames are no raw counts. "
            "Turn noise reduction, gamma and automatic gain off and retake the ramp."
        )
    return gain, float(np.sqrt(covariance[0, 0])), float(np.sqrt(max(solution[1], 0.0)))


def _linearity(
    dark: LevelStatistics, levels: list[LevelStatistics], exposures_s: tuple[float, ...] | None
) -> tuple[tuple[tuple[float, float], ...], float]:
    """(light, response) pairs, each 0..1, and the largest departure from the straight line."""
    if exposures_s is None:
        return (), 0.0
    if len(exposures_s) != len(levels):
        raise ImageError(f"{len(exposures_s)} exposures for {len(levels)} bursts; expected one each.")
    pairs = sorted(
        (t, s.mean - dark.mean) for t, s in zip(exposures_s, levels, strict=True) if s.saturated < 1e-4
    )
    light = np.array([t for t, _ in pairs])
    response = np.array([r for _, r in pairs])
    slope = float(light @ response / (light @ light))
    departure = np.abs(response - slope * light).max() / response.max()
    top = slope * light.max()
    return tuple((float(a), float(b)) for a, b in zip(slope * light / top, response / top, strict=True)), (
        float(departure)
    )


def _gamma(grey: Float[np.ndarray, " n"], light: Float[np.ndarray, " n"]) -> float:
    exponents = np.linspace(0.3, 4.0, 3701)
    errors = ((grey[None, :] ** exponents[:, None] - light) ** 2).sum(axis=1)
    return float(exponents[int(np.argmin(errors))])


def _advice(levels: list[LevelStatistics], nonlinearity: float) -> tuple[str, ...]:
    saturated = [i for i, s in enumerate(levels) if s.saturated >= 1e-4]
    advice = []
    if saturated:
        listed = ", ".join(map(str, saturated))
        advice.append(f"Levels {listed} are saturated and were left out; retake them with less light.")
    if nonlinearity > 0.01:
        advice.append(
            f"The camera departs from a straight line by {100 * nonlinearity:.1f} %. "
            "Turn its gamma off, or keep the pattern in the straight part."
        )
    return tuple(advice)


def _check_white(white: Burst, end: int) -> None:
    saturated = float(np.mean(white >= end))
    if saturated > SATURATED_FRACTION:
        raise ImageError(
            f"{100 * saturated:.0f} % of the brightest grey level is saturated, at {end} counts; expected at "
            f"most {100 * SATURATED_FRACTION:.0f} %. Retake the grey ramp with a shorter exposure."
        )


def _check(dark: Burst, ramp: tuple[Burst, ...]) -> None:
    shapes = {burst.shape[1:] for burst in (dark, *ramp)}
    if len(shapes) != 1:
        raise ImageError(f"The frames have {len(shapes)} sizes; expected one. Retake them in one mode.")
    if min(len(burst) for burst in (dark, *ramp)) < 2:
        raise ImageError("A burst has fewer than 2 frames; noise needs at least 2 of each level, better 8.")
