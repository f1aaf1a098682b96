"""What all places have wrong together, against the whole covariance."""

import numpy as np
import pytest

from core.shared_errors import broad, rise_of, shared_errors

SHAPE = (4, 3, 5)
POINTS = 60


def covariance(independent: np.ndarray) -> np.ndarray:
    return np.einsum("ea,eb->ab", independent, independent)


def rows_of(whole: np.ndarray) -> np.ndarray:
    return (broad(SHAPE).reshape(2, POINTS) @ whole).reshape(2, *SHAPE)


def test_the_mean_and_the_rise_are_shared_and_nothing_of_them_is_left():
    whole = covariance(np.random.default_rng(0).standard_normal((8, POINTS)))
    found = shared_errors(rows_of(whole))
    together = found.fields.reshape(2, POINTS)

    left = whole - together.T @ together
    weights = broad(SHAPE).reshape(2, POINTS)
    np.testing.assert_allclose(weights @ left, 0.0, atol=1e-12)
    # Nothing is taken twice: what is left is a covariance.
    assert np.linalg.eigvalsh(left).min() > -1e-10


def test_an_error_without_its_shared_part_has_no_mean_and_no_rise():
    independent = np.random.default_rng(1).standard_normal((8, POINTS))
    found = shared_errors(rows_of(covariance(independent)))
    left = found.without(independent[0].reshape(SHAPE))
    assert left.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.sum(rise_of(SHAPE) * left) == pytest.approx(0.0, abs=1e-12)


def test_what_cannot_be_told_apart_is_one_error_and_what_is_certain_is_none():
    level = np.ones((1, POINTS))
    assert shared_errors(rows_of(covariance(level))).fields.shape == (1, *SHAPE)
    assert shared_errors(np.zeros((2, *SHAPE))).fields.shape == (0, *SHAPE)


def test_a_profile_rises_by_its_difference_between_floor_and_ceiling():
    profile = np.broadcast_to(np.linspace(20.0, 23.0, SHAPE[2]), SHAPE)
    assert np.sum(rise_of(SHAPE) * profile) == pytest.approx(3.0)
