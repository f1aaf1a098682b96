import numpy as np
import pytest

from calibration.errors import ImageError
from calibration.response import flat_field, measure_camera, measure_projector

SHAPE = (240, 320)
# A 10-bit camera: counts = 16 + 0.1 electrons.
GAIN, DARK, READ_E = 0.1, 16.0, 6.0


def burst(electrons: float, frames: int, rng: np.random.Generator, flicker: float = 0.0) -> np.ndarray:
    """Frames of steady light with shot noise, read noise, a fixed pattern and common flicker."""
    pattern = 1 + 0.05 * np.random.default_rng(99).standard_normal(SHAPE)
    light = electrons * pattern * (1 + flicker * rng.standard_normal((frames, 1, 1)))
    total = rng.poisson(np.clip(light, 0, None)) + rng.normal(0, READ_E, (frames, *SHAPE))
    return np.clip(np.rint(total * GAIN + DARK), 0, 1023).astype(np.uint16)


def test_gain_read_noise_and_full_well_come_out_of_a_ramp_to_half_a_percent():
    rng = np.random.default_rng(1)
    ramp = tuple(burst(e, 8, rng, flicker=0.01) for e in (500, 1500, 3000, 5000, 7000, 8500))

    found = measure_camera("camera", burst(0, 16, rng), ramp, bits=10)

    assert found.gain_counts_per_e == pytest.approx(GAIN, rel=5e-3)
    assert found.dark_counts == pytest.approx(DARK, rel=5e-3)
    assert found.full_well_e == pytest.approx((1023 - DARK) / GAIN, rel=5e-3)
    # Read noise is 0.6 counts, no more than digitisation: known to a few percent.
    assert found.read_noise_e == pytest.approx(READ_E, rel=0.05)
    assert abs(found.gain_counts_per_e - GAIN) < 5 * found.gain_std_counts_per_e
    assert found.noise.bits == 10


def test_linearity_is_measured_against_exposure_time_and_saturated_levels_are_named():
    rng = np.random.default_rng(2)
    exposures = (0.002, 0.005, 0.01, 0.02, 0.05)
    straight = measure_camera(
        "camera", burst(0, 4, rng), tuple(burst(4e5 * t, 4, rng) for t in exposures), 10, exposures
    )
    bent = measure_camera(
        "camera",
        burst(0, 4, rng),
        tuple(burst(4e5 * t * (1 - 4 * t), 4, rng) for t in exposures),
        10,
        exposures,
    )

    assert straight.nonlinearity < 0.005
    assert any("Levels 4 are saturated" in a for a in straight.quality.advice)
    # The curve 1 - 4 t bends by 4 % of full light over the four levels that are used.
    assert 0.01 < bent.nonlinearity < 0.06
    assert any("straight line" in a for a in bent.quality.advice)


def test_a_projector_s_curve_and_exponent_are_found_to_half_a_percent():
    rng = np.random.default_rng(3)
    levels = tuple(np.linspace(0, 1, 9))
    light = [0.01 + 0.99 * g**2.2 for g in levels]
    found = measure_projector(levels, tuple(burst(8000 * v, 4, rng) for v in light), DARK, 10)

    assert found.gamma == pytest.approx(2.2, rel=5e-3)
    np.testing.assert_allclose(found.luminance, light, atol=5e-3)
    assert found.black_level == pytest.approx(0.01, abs=2e-3)


@pytest.mark.parametrize(("last", "end", "step"), [(1023, 1023, 64), (940, 940, 1)])
def test_a_camera_whose_counts_end_below_full_scale_is_seen_to_saturate(last, end, step):
    """10 bits at the top of 16, and a sensor that clips at 940 of 1023."""
    rng = np.random.default_rng(6)
    bits = 16 if step > 1 else 10
    light = (1500, 4000, 6500, (last - DARK) / GAIN)
    ramp = tuple(np.minimum(burst(e, 8, rng), end) * np.uint16(step) for e in light)
    dark = burst(0, 8, rng) * np.uint16(step)

    found = measure_camera("camera", dark, ramp, bits)

    assert found.gain_counts_per_e / step == pytest.approx(GAIN, rel=0.01)
    assert any("Levels 3 are saturated" in a for a in found.quality.advice)
    levels = (0.0, 0.4, 0.7, 1.0)
    with pytest.raises(ImageError, match=f"saturated, at {end * step} counts"):
        measure_projector(levels, ramp, DARK * step, bits)
    with pytest.raises(ImageError, match="shorter exposure"):
        flat_field(ramp[-1], dark, bits)


def test_what_is_no_ramp_of_raw_frames_is_refused():
    rng = np.random.default_rng(4)
    dark = burst(0, 4, rng)
    with pytest.raises(ImageError, match="expected at least 3"):
        measure_camera("camera", dark, tuple(burst(e, 4, rng) for e in (3e4, 4e4, 5e4)), 10)
    still = tuple(np.repeat(burst(e, 1, rng), 4, axis=0) for e in (1000, 3000, 6000))
    with pytest.raises(ImageError, match="no raw counts"):
        measure_camera("camera", dark, still, 10)
    with pytest.raises(ImageError, match="does not grow"):
        measure_projector(
            (0.0, 0.3, 0.6, 1.0), tuple(burst(e, 2, rng) for e in (10, 6000, 3000, 8000)), DARK, 10
        )
    with pytest.raises(ImageError, match="fewer than 2 frames"):
        measure_camera("camera", dark[:1], (dark, dark, dark), 10)


def test_the_flat_field_is_vignetting_over_its_median():
    rng = np.random.default_rng(5)
    y, x = np.mgrid[-1 : 1 : SHAPE[0] * 1j, -1 : 1 : SHAPE[1] * 1j]
    fall = 1 - 0.3 * (x**2 + y**2) / 2
    white = np.rint(800 * fall + rng.normal(0, 2, (8, *SHAPE)) + DARK)
    black = np.rint(rng.normal(0, 2, (8, *SHAPE)) + DARK)

    flat = flat_field(white, black, 10)

    np.testing.assert_allclose(flat, fall / np.median(fall), atol=0.012)
