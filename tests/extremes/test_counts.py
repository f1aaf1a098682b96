"""What a camera counts: moments, verdicts, photon transfer, grey ramps, from one count to 65,535."""

import numpy as np
import pytest

from calibration.response import flat_field, level_statistics, measure_camera, measure_projector
from drivers.burst import CapturePlan
from drivers.moments import RunningMoments
from drivers.simulated.sensor import ExpectedCounts, SensorNoise
from drivers.verdict import judge_beat, judge_dark, judge_flicker, judge_images, judge_saturation
from tests.extremes.row import Named, Near, Refused, Row, extremes, prove

STAGE = "counts"


def burst(frames: int, rows: int, cols: int, counts: int, seed: int = 0) -> np.ndarray:
    """Uniform counts over the whole range, the full scale included."""
    dtype = np.uint8 if counts < 256 else np.uint16
    return np.random.default_rng(seed).integers(0, counts + 1, (frames, rows, cols)).astype(dtype)


def moments(name: str, frames: np.ndarray, full_scale: int) -> Row:
    """Mean and deviation against NumPy in float64."""

    def run() -> np.ndarray:
        running = RunningMoments()
        for frame in frames:
            running.add(frame)
        return np.stack([running.mean(full_scale), running.std(full_scale)])

    wide = frames.astype(float) / full_scale
    spread = wide.std(axis=0, ddof=1) if len(frames) > 1 else np.zeros(wide.shape[1:])
    expected = np.stack([wide.mean(axis=0), spread])
    return Row(STAGE, f"moments of {name}", run, Near(expected, rel=2e-7, abs=1e-7))


def constant(counts: int, bits: int) -> np.ndarray:
    return np.full((5, 8, 8), counts, np.uint8 if bits <= 8 else np.uint16)


def photons(level: float, noise: SensorNoise, frames: int = 12, seed: int = 0) -> np.ndarray:
    """A burst of an even light, as the simulated sensor counts it."""
    view = ExpectedCounts.of(np.full((64, 64), level, np.float32), noise, 1.0, 1.0)
    return np.stack([view.draw(seed, int(1e4 * level) * 100 + i) for i in range(frames)])


def gain(bits: int, full_well_e: float) -> Row:
    """Photon transfer finds the counts an electron makes."""
    dark_counts = 0.02 * (2**bits - 1)
    noise = SensorNoise(full_well_e=full_well_e, read_noise_e=3.0, dark_counts=dark_counts, bits=bits)

    def run() -> float:
        ramp = tuple(photons(level, noise) for level in (0.1, 0.3, 0.5, 0.8))
        return measure_camera("camera", photons(0.0, noise), ramp, bits).gain_counts_per_e

    # The variance of 12 frames of 4096 px scatters by 0.7 %; in 8 bits the digitiser's steps are of its size.
    exact = (2**bits - 1 - dark_counts) / full_well_e
    return Row(
        STAGE,
        f"gain, {bits} bits of {full_well_e:g} electrons",
        run,
        Near(exact, rel=0.1 if bits == 8 else 0.05),
    )


def response(name: str, words: str, dark: np.ndarray, ramp: tuple[np.ndarray, ...], bits: int = 12) -> Row:
    return Row(
        STAGE, name, lambda: measure_camera("camera", dark, ramp, bits).gain_counts_per_e, Refused(words)
    )


def ramp(name: str, words: str, levels: tuple[float, ...], counts: tuple[int, ...]) -> Row:
    bursts = tuple(constant(c, 12) for c in counts)
    return Row(STAGE, name, lambda: measure_projector(levels, bursts, 0.0, 12).gamma, Refused(words))


def verdict(name: str, expected: str, value: float) -> Row:
    """Which of a picture's verdicts are bad."""
    mean, std = np.full((64, 64), value, np.float32), np.zeros((64, 64), np.float32)

    def run() -> str:
        return " ".join(v.name for v in judge_images(mean, std, 10) if not v.good)

    return Row(STAGE, name, run, Named(expected))


NOISE = SensorNoise()
DARK = photons(0.0, NOISE)
FULL = np.full((5, 64, 64), 4095, np.uint16)
LEVELS = (0.0, 0.25, 0.5, 1.0)

ROWS = [
    moments("1 bit, 8 x 8 px", burst(9, 8, 8, 1), 1),
    moments("8 bits", burst(9, 16, 16, 255), 255),
    moments("16 bits", burst(9, 16, 16, 65_535), 65_535),
    moments("8192 x 8 px, 16 bits", burst(3, 8, 8192, 65_535), 65_535),
    moments("one frame", burst(1, 8, 8, 4095), 4095),
    moments("300 frames beside full scale", 65_535 - (burst(300, 8, 8, 1, 1)).astype(np.uint16), 65_535),
    moments("darkness", constant(0, 8), 255),
    moments("saturation, 16 bits", constant(65_535, 16), 65_535),
    *[gain(b, e) for b in (8, 10, 12, 16) for e in (1e3, 1e4, 1e5) if not (b == 8 and e == 1e5)],
    Row(STAGE, "statistics of darkness", lambda: level_statistics(constant(0, 12), 4095).variance, Near(0.0)),
    Row(STAGE, "statistics of saturation", lambda: level_statistics(FULL, 4095).saturated, Near(1.0)),
    response("a saturated ramp", "shorten the exposure", DARK, (FULL, FULL, FULL)),
    response("a dark ramp", "brighter than dark", DARK, (DARK, DARK, DARK)),
    response("one frame a level", "fewer than 2 frames", DARK[:1], (DARK[:1],) * 3),
    response("frames of two sizes", "sizes", DARK, (constant(900, 12),) * 3),
    response(
        "light without noise", "no raw counts", constant(10, 12), tuple(constant(c, 12) for c in (50, 90, 200))
    ),
    Row(STAGE, "flat field of a constant", lambda: flat_field(constant(4094, 12), constant(10, 12), 12), Near(1.0)),
    Row(STAGE, "flat field of saturation", lambda: flat_field(FULL, DARK, 12), Refused("shorter exposure")),
    Row(STAGE, "flat field of darkness", lambda: flat_field(DARK * 0, DARK * 0, 12), Refused("not brighter")),
    ramp("a grey ramp of darkness", "does not grow", LEVELS, (0, 0, 0, 0)),
    ramp("a grey ramp upside down", "Check the order", LEVELS, (4000, 3000, 2000, 1000)),
    ramp("three grey levels", "at least 4", LEVELS[:3], (0, 5, 9)),
    Row(STAGE, "a straight grey ramp, 16 bits",
        lambda: measure_projector(LEVELS, tuple(constant(c, 16) for c in (0, 16000, 32000, 64000)), 0.0, 16).gamma,
        Near(1.0, abs=2e-3)),
    ramp("a saturated grey ramp", "shorten the exposure", LEVELS, (4095,) * 4),
    verdict("verdicts on darkness", "level contrast focus", 0.0),
    verdict("verdicts on saturation", "level contrast focus", 1.0),
    verdict("verdicts on grey", "contrast focus", 0.5),
    Row(STAGE, "flicker of darkness", lambda: judge_flicker([0.0, 0.0]).value, Near(0.0)),
    Row(STAGE, "flicker of no frame", lambda: judge_flicker([]).value, Near(0.0)),
    Row(STAGE, "every pixel saturated", lambda: float(judge_saturation([1.0], 0.02).good), Near(0.0)),
    Row(STAGE, "dark frame in the light", lambda: float(judge_dark(np.ones((8, 8), np.float32)).good), Near(0.0)),
    Row(STAGE, "exposure of 1 us at 60 Hz", lambda: float(judge_beat(1e-6, 60.0).good), Near(0.0)),
    Row(STAGE, "exposure of an hour", lambda: judge_beat(3600.0, 60.0).value, Near(216_000.0)),
    Row(STAGE, "a capture of no frames", lambda: float(CapturePlan(frames=0).frames), Refused("at least one")),
    Row(STAGE, "a capture that settles for -1 s", lambda: CapturePlan(settle_s=-1.0).settle_s,
        Refused("no negative")),
]  # fmt: skip


@extremes(ROWS)
def test_counts_at_their_limits(row: Row, record_property):
    prove(row, record_property)


def test_a_frame_of_another_size_is_refused_by_the_moments():
    running = RunningMoments()
    running.add(np.zeros((8, 8), np.uint8))

    with pytest.raises(ValueError, match="changed its format"):
        running.add(np.zeros((8, 9), np.uint8))
