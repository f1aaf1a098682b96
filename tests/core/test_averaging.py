"""The error of a short mean, against means that are drawn: white and correlated bursts, clear and noisy pictures."""

import numpy as np
import pytest

from core.averaging import short_mean

WINDOWS, BURSTS = 300, 16


def moving(generator, correlation):
    """Coefficients of three patterns whose bursts are correlated with the one before, from long after their start."""
    state, rows = generator.standard_normal(3), []
    for _ in range(BURSTS):
        step = generator.standard_normal(3)
        state = correlation * state + (1 - correlation**2) ** 0.5 * step
        rows.append(state)
    return np.array(rows)


def found_and_true(correlation, noise_px, rooms=100):
    """Variance of the mean of bursts, as found in each of many sequences and as it is."""
    generator = np.random.default_rng(5)
    patterns = 0.01 * generator.standard_normal((3, WINDOWS, 2))
    found, true = [], []
    for _ in range(rooms):
        coefficients = moving(generator, correlation)
        noise = noise_px * generator.standard_normal((BURSTS, WINDOWS, 2))
        shifts = np.einsum("nk,kwa->nwa", coefficients, patterns) + noise
        information = np.tile(np.eye(2) / noise_px**2, (WINDOWS, 1, 1))
        found.append(short_mean(shifts, information).rms_px ** 2)
        true.append(np.mean(np.einsum("k,kwa->wa", coefficients.mean(0), patterns) ** 2))
    return np.array(found), np.mean(true)


@pytest.mark.parametrize("noise_px", [0.003, 0.02])
@pytest.mark.parametrize(("correlation", "low", "high"), [(0.0, 0.8, 1.5), (0.5, 0.7, 1.5), (0.8, 0.35, 1.5)])
def test_the_error_of_a_mean_is_as_large_as_is_found(noise_px, correlation, low, high):
    """Sixteen bursts of a correlation of 0.8 are worth two or three: from so few, half the variance is seen."""
    found, true = found_and_true(correlation, noise_px)
    assert low < np.median(found) / true < high


def test_bursts_that_hold_only_noise_have_a_mean_without_other_errors():
    generator = np.random.default_rng(0)
    noise_px = 0.01
    shifts = noise_px * generator.standard_normal((BURSTS, WINDOWS, 2))
    found = short_mean(shifts, np.tile(np.eye(2) / noise_px**2, (WINDOWS, 1, 1)))
    assert found.rms_px < 0.3 * noise_px / BURSTS**0.5


def test_the_modes_are_the_patterns_that_moved_and_windows_of_no_information_are_carried_along():
    generator = np.random.default_rng(0)
    pattern = generator.standard_normal((WINDOWS, 2))
    shifts = generator.standard_normal(BURSTS)[:, None, None] * pattern
    information = np.tile(np.eye(2) / 1e-4, (WINDOWS, 1, 1))
    information[0] = 0.0
    found = short_mean(shifts, information)
    leading = found.modes_px[..., -1]
    assert abs(np.sum(leading * pattern)) > 0.999 * np.linalg.norm(leading) * np.linalg.norm(pattern)


def test_two_bursts_are_too_few():
    with pytest.raises(ValueError, match="2 bursts; expected at least 3"):
        short_mean(np.zeros((2, 5, 2)), np.tile(np.eye(2), (5, 1, 1)))
