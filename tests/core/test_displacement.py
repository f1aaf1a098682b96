import numpy as np
import pytest
from scipy import ndimage

from core.displacement import (
    Similarity,
    derivative_filter,
    fit_similarity,
    measure_shift,
    move_image,
    standard_deviation_px,
)
from core.setting import SettingError


def band_limited(shape, seed, shift=(0.0, 0.0), shortest_px=3.0):
    """A periodic random image, exactly shifted by (column, row) px in the Fourier domain."""
    rng = np.random.default_rng(seed)
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1])[None]
    spectrum = np.fft.fft2(rng.standard_normal(shape)) * (np.hypot(fx, fy) < 1 / shortest_px)
    image = np.fft.ifft2(spectrum * np.exp(-2j * np.pi * (fx * shift[0] + fy * shift[1]))).real
    return (0.5 + 0.1 * image / 0.55).astype(np.float32)


def test_derivative_filter_is_exact_to_a_thousandth_up_to_a_period_of_two_and_a_half_pixels():
    taps = derivative_filter()
    offsets = np.arange(len(taps)) - len(taps) // 2
    for cycles_per_px in (0.01, 0.1, 0.2, 0.3, 0.38):
        omega = 2 * np.pi * cycles_per_px
        response = np.sum(taps * np.sin(omega * offsets))
        assert response == pytest.approx(omega, rel=1e-3)


@pytest.mark.parametrize("shift", [(0.005, 0.0), (0.0, -0.003), (0.02, 0.015)])
def test_a_known_shift_far_below_a_pixel_is_found_within_one_percent(shift):
    reference, flow = band_limited((256, 320), 1), band_limited((256, 320), 1, shift)

    found = measure_shift(reference, flow, 1e-6, 32)

    # Interior windows: the filter sees no edge there.
    inner = np.all((found.centres_px > 32) & (found.centres_px < np.array([288, 224])), axis=1)
    # Limited by the 1e-3 of the derivative filter and by float32 images (6e-8 of 0.5).
    np.testing.assert_allclose(found.displacement_px[inner], np.tile(shift, (inner.sum(), 1)), atol=1e-4)


def test_the_stated_standard_deviation_is_the_scatter():
    rng = np.random.default_rng(3)
    reference, flow = band_limited((512, 512), 2), band_limited((512, 512), 2, (0.004, -0.002))
    noise = 2e-3
    a = (reference + noise * rng.standard_normal(reference.shape)).astype(np.float32)
    b = (flow + noise * rng.standard_normal(flow.shape)).astype(np.float32)

    found = measure_shift(a, b, 2 * noise**2, 32)

    normalised = (found.displacement_px - [0.004, -0.002]) / standard_deviation_px(found)
    # 512 numbers: their standard deviation is known to 3 %; four sigma.
    assert normalised.std() == pytest.approx(1.0, abs=0.12)
    assert abs(normalised.mean()) < 4 / np.sqrt(normalised.size)


def test_a_lamp_that_changes_by_two_percent_does_not_move_the_pattern():
    reference, flow = band_limited((256, 256), 4), band_limited((256, 256), 4, (0.01, 0.0))

    found = measure_shift(reference, (1.02 * flow + 0.003).astype(np.float32), 1e-6, 32)

    assert np.median(found.displacement_px[:, 0]) == pytest.approx(0.01, rel=0.02)
    assert abs(np.median(found.displacement_px[:, 1])) < 2e-4


def test_drift_is_found_on_the_border_and_taken_out():
    reference = band_limited((256, 256), 5, shortest_px=4.0)
    drift = Similarity(column_px=0.2, row_px=-0.13, rotation_rad=1e-4, dilation=-5e-5)
    moved = move_image(reference, drift)
    first = measure_shift(reference, moved, 1e-6, 16)
    border = np.any((first.centres_px < 48) | (first.centres_px > 208), axis=1)

    found, _ = fit_similarity(first, border, reference.shape)
    second = measure_shift(move_image(reference, found), moved, 1e-6, 16)
    rest, _ = fit_similarity(second, border, reference.shape)

    total = rest.after(found)
    assert total.column_px == pytest.approx(0.2, abs=1e-3)
    assert total.row_px == pytest.approx(-0.13, abs=1e-3)
    assert total.rotation_rad == pytest.approx(1e-4, abs=1e-5)


def test_moving_an_image_moves_it_the_stated_way():
    image = np.zeros((9, 9), np.float32)
    image[4, 4] = 1.0
    moved = move_image(ndimage.gaussian_filter(image, 1.0), Similarity(column_px=2.0, row_px=-1.0))
    assert np.unravel_index(moved.argmax(), moved.shape) == (3, 6)


def test_a_blank_window_says_that_it_knows_nothing():
    blank = np.full((64, 64), 0.5, np.float32)
    found = measure_shift(blank, blank, 1e-6, 32)
    assert np.all(found.displacement_px == 0)
    assert np.all(standard_deviation_px(found) > 100)


@pytest.mark.parametrize(
    ("flow_shape", "words"), [((64, 60), "equal sizes"), ((64, 64), "smaller than one window")]
)
def test_pairs_that_cannot_be_compared_are_refused(flow_shape, words):
    with pytest.raises(SettingError, match=words):
        measure_shift(np.ones((64, 64), np.float32), np.ones(flow_shape, np.float32), 1.0, 80)
