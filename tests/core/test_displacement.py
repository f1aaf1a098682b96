from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from core.displacement import measure_shift, standard_deviation_px, window_centres
from core.drift import STILL, fit_motion, move_image
from core.geometry import looking_along_y
from core.motion import motion_basis
from core.setting import SettingError
from core.window_fit import derivative_filter

LENS = looking_along_y(position_m=(0.0, 0.0, 0.0), width_px=256, height_px=256, focal_px=1e4)


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
    drift_px = np.array([0.2, -0.13, -6e-3, 0.0128, 0.1, 0.05])
    moved = move_image(reference, drift_px, LENS)
    first = measure_shift(reference, moved, 1e-6, 16)
    border = np.any((first.centres_px < 48) | (first.centres_px > 208), axis=1)

    found_px, _ = fit_motion(first, border, LENS, STILL, 1.0)
    second = measure_shift(move_image(reference, found_px, LENS), moved, 1e-6, 16)
    rest_px, _ = fit_motion(second, border, LENS, -found_px, 1.0)

    # Of a lens so long nobody can tell a turn from a sensor that is carried; what both do is known.
    basis = motion_basis(first.centres_px, LENS)
    np.testing.assert_allclose(basis @ (found_px + rest_px), basis @ drift_px, atol=1e-3)


def test_what_is_known_before_decides_where_nothing_is_seen():
    blind = measure_shift(*2 * (np.full((64, 64), 0.5, np.float32),), 1e-6, 32)
    expected_px = np.array([0.3, 0.0, 0.0, -0.1, 0.0, 0.2])
    found_px, covariance = fit_motion(blind, np.ones(len(blind.centres_px), bool), LENS, expected_px, 0.5)
    np.testing.assert_allclose(found_px, expected_px, atol=1e-4)
    np.testing.assert_allclose(covariance, 0.25 * np.eye(6), atol=1e-3)


def test_moving_an_image_moves_it_the_stated_way():
    image = np.zeros((9, 9), np.float32)
    image[4, 4] = 1.0
    by_px = np.array([2.0, -1.0, 0.0, 0.0, 0.0, 0.0])
    moved = move_image(ndimage.gaussian_filter(image, 1.0), by_px, replace(LENS, width_px=9, height_px=9))
    assert np.unravel_index(moved.argmax(), moved.shape) == (3, 6)


def test_a_picture_that_moves_and_moves_back_is_the_same():
    wide = replace(LENS, focal_px=(180.0, 180.0), distortion=(-0.1, 0.02, 0.0, 0.0, 0.0))
    picture = band_limited((256, 256), 7, shortest_px=8.0)
    by_px = np.array([0.4, -0.3, 0.5, -0.8, 1.0, 0.7])
    back = move_image(move_image(picture, by_px, wide), -by_px, wide)
    # Second order in the motion: 1 px over 180 px.
    inner = np.s_[12:-12, 12:-12]
    assert np.abs(back - picture)[inner].max() < 0.02 * np.abs(picture - picture.mean()).max()


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


def seen_by_a_camera(image, frames, rng, full_well_e=1e4):
    """A picture as so many frames show it on average: shot noise only. And the variance of that mean."""
    variance = np.maximum(image, 1e-3) / full_well_e / frames
    return (image + rng.standard_normal(image.shape) * np.sqrt(variance)).astype(np.float32), variance


@pytest.mark.parametrize(
    ("shift_px", "light", "frames"),
    [(0.02, 0.5, 100), (0.3, 0.5, 100), (2.0, 0.5, 100), (5.0, 0.5, 100), (0.3, 0.03, 1)],
)
def test_a_local_shift_of_any_length_is_found_within_what_is_stated(shift_px, light, frames):
    shift = shift_px * np.array([1.0, -0.6])
    rng = np.random.default_rng(7)
    pictures = [2 * light * band_limited((256, 256), 8, s, shortest_px=5.0) for s in ((0, 0), shift)]
    (reference, before), (flow, after) = (seen_by_a_camera(p.astype(float), frames, rng) for p in pictures)

    found = measure_shift(reference, flow, before + after, 32)

    inner = np.all((found.centres_px > 40) & (found.centres_px < 216), axis=1)
    error = found.displacement_px[inner] - shift
    z = error / standard_deviation_px(found)[inner]
    # 32 numbers: their rms is known to 13 %; three sigma.
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.4
    # One picture in dim light without the noise taken out of the matrix: -15 %, twelve of these deviations.
    assert abs(np.mean(z @ shift) / np.hypot(*shift)) < 4 / np.sqrt(len(z))


def test_a_lamp_that_ripples_does_not_pass_for_a_shift():
    rng = np.random.default_rng(1)
    reference = band_limited((256, 256), 8, shortest_px=5.0).astype(float)
    flow = band_limited((256, 256), 8, (0.01, 0.0), shortest_px=5.0).astype(float)
    flow *= 1 + 0.01 * np.cos(2 * np.pi * np.arange(256) / 60)
    (a, before), (b, after) = seen_by_a_camera(reference, 100, rng), seen_by_a_camera(flow, 100, rng)

    found = measure_shift(a, b, before + after, 32)

    z = (found.displacement_px - [0.01, 0.0]) / standard_deviation_px(found)
    assert np.sqrt(np.mean(z**2)) < 1.5
    assert found.refused is not None
    assert not found.refused.any()


def test_a_lamp_that_ripples_adds_little_noise_and_none_that_is_not_stated():
    errors = []
    for ripple in (0.0, 0.01):
        rng = np.random.default_rng(1)
        reference = band_limited((256, 256), 8, shortest_px=8.0).astype(float)
        flow = band_limited((256, 256), 8, (0.01, 0.0), shortest_px=8.0).astype(float)
        flow *= 1 + ripple * np.cos(2 * np.pi * np.arange(256) / 60)
        (a, before), (b, after) = seen_by_a_camera(reference, 400, rng), seen_by_a_camera(flow, 400, rng)
        found = measure_shift(a, b, before + after, 16)
        errors.append(found.displacement_px - [0.01, 0.0])

    def rms(values):
        return np.sqrt(np.mean(values**2))

    # 512 numbers, known to 3 %. A gain of first order leaves 2.4 times the noise, and says half of it.
    assert rms(errors[1]) < 1.2 * rms(errors[0])
    assert rms(errors[1] / standard_deviation_px(found)) < 1.2


@pytest.mark.parametrize("radius_px", [70, 170])
@pytest.mark.parametrize("covering", ["something plain", "another pattern", "a pattern that moves"])
def test_windows_that_something_covers_are_refused_and_the_others_are_not(covering, radius_px):
    rng = np.random.default_rng(2)
    reference = band_limited((384, 384), 8, shortest_px=5.0).astype(float)
    flow = band_limited((384, 384), 8, (0.02, 0.01), shortest_px=5.0).astype(float)
    rows, columns = np.mgrid[:384, :384]
    covered = (columns - 200) ** 2 + (rows - 180) ** 2 < radius_px**2
    other = band_limited((384, 384), 9, (1.5, 0.5), shortest_px=9.0)
    flow[covered] = {"something plain": 0.35, "another pattern": other[covered]}.get(covering, 0.0)
    if covering == "a pattern that moves":
        reference[covered] = band_limited((384, 384), 9, shortest_px=5.0)[covered]
        flow[covered] = band_limited((384, 384), 10, shortest_px=5.0)[covered]
    (a, before), (b, after) = seen_by_a_camera(reference, 100, rng), seen_by_a_camera(flow, 100, rng)

    found = measure_shift(a, b, before + after, 32)

    share = covered.reshape(12, 32, 12, 32).mean(axis=(1, 3)).ravel()
    # The gradient's filter reaches 10 px beyond a window.
    clear = ndimage.maximum_filter(covered, 21).reshape(12, 32, 12, 32).max(axis=(1, 3)).ravel() == 0
    assert found.refused is not None
    assert found.refused[share > 0.02].mean() >= 0.95
    assert found.refused[clear].mean() <= 0.02


def test_a_windows_centre_is_the_mean_of_its_pixels_places():
    # Windows of 4 px: pixels 0 to 3 and 4 to 7 along a row, 0 to 3 down; what is left over belongs to none.
    np.testing.assert_array_equal(window_centres((5, 9), 4), [[1.5, 1.5], [5.5, 1.5]])


def test_a_bare_window_beside_something_bright_does_not_say_that_it_is_still():
    """The gradient's filter reaches into it from beyond, and between its own pixels of both pictures is nothing."""
    random, noise = np.random.default_rng(4), 1e-4
    reference, flow = (0.02 + noise * random.standard_normal((64, 64)) for _ in range(2))
    # The bright thing fills a window of its own.
    for picture in (reference, flow):
        picture[27, 28] = 1.0

    found = measure_shift(reference, flow, 2 * noise**2, 8)

    beside = np.abs(found.centres_px - (28, 27)).max(axis=1) > 4.0
    assert np.trace(found.information_per_px2, axis1=1, axis2=2)[beside].max() < 1e-3
