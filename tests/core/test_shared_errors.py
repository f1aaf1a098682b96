"""What all places have wrong together, against the whole covariance."""

import numpy as np
import pytest

from core.shared_errors import broad, shared_errors

SHAPE = (4, 3, 5)
POINTS = 60


def covariance(independent: np.ndarray) -> np.ndarray:
    return np.einsum("ea,eb->ab", independent, independent)


def rows_of(whole: np.ndarray, count: int = 2) -> np.ndarray:
    return (broad(SHAPE, count).reshape(count, POINTS) @ whole).reshape(count, *SHAPE)


@pytest.mark.parametrize("count", [2, 4])
def test_the_mean_and_the_rise_are_shared_and_nothing_of_them_is_left(count: int):
    whole = covariance(np.random.default_rng(0).standard_normal((8, POINTS)))
    found = shared_errors(rows_of(whole, count))
    together = found.fields.reshape(count, POINTS)

    left = whole - together.T @ together
    weights = broad(SHAPE, count).reshape(count, POINTS)
    np.testing.assert_allclose(weights @ left, 0.0, atol=1e-12)
    # Nothing is taken twice: what is left is a covariance.
    assert np.linalg.eigvalsh(left).min() > -1e-10


def test_an_error_without_its_shared_part_has_no_mean_and_no_rise():
    independent = np.random.default_rng(1).standard_normal((8, POINTS))
    found = shared_errors(rows_of(covariance(independent)))
    left = found.without(independent[0].reshape(SHAPE))
    assert left.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.sum(broad(SHAPE)[1] * left) == pytest.approx(0.0, abs=1e-12)


def test_what_cannot_be_told_apart_is_one_error_and_what_is_certain_is_none():
    level = np.ones((1, POINTS))
    assert shared_errors(rows_of(covariance(level))).fields.shape == (1, *SHAPE)
    assert shared_errors(np.zeros((2, *SHAPE))).fields.shape == (0, *SHAPE)


def test_a_profile_is_told_as_its_mean_its_rise_and_its_bend():
    height = np.linspace(-1.0, 1.0, SHAPE[2])
    profile = np.broadcast_to(21.5 + 1.5 * height, SHAPE)
    np.testing.assert_allclose(
        np.tensordot(broad(SHAPE, 4), profile, axes=3), [21.5, 3.0, 0.0, 0.0], atol=1e-12
    )
    bent = np.broadcast_to(height**2 - np.mean(height**2), SHAPE)
    mean, rise, bend, _ = np.tensordot(broad(SHAPE, 4), bent, axes=3)
    assert (mean, rise) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert bend == pytest.approx(2 / 1.5)
