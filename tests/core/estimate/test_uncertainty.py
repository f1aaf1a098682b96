import numpy as np
import pytest

from core.estimate.uncertainty import Represented, deviation

SHAPE = (6, 5, 7)
NOTHING = Represented(np.zeros(SHAPE), np.zeros(SHAPE), 0.0, (1.0, 1.0, 1.0))


def test_parameters_spread_by_their_posterior_and_inform_where_it_is_narrow():
    warmer, stronger = np.ones(SHAPE), np.zeros(SHAPE)
    stronger[3:] = 2.0
    # Prior variances are 1; the second parameter is halved in deviation, and they go against one another.
    covariance = np.array([[0.5, -0.2], [-0.2, 0.25]])

    slopes = np.stack([warmer, stronger])
    found = deviation(slopes, slopes, covariance, NOTHING)

    np.testing.assert_allclose(found.std[:3] ** 2, 0.5, rtol=1e-6)
    np.testing.assert_allclose(found.std[3:] ** 2, 0.5 + 4 * 0.25 + 2 * 2 * -0.2, rtol=1e-6)
    np.testing.assert_allclose(found.informed[:3], 0.5, rtol=1e-6)
    np.testing.assert_allclose(found.informed[3:], 1 - 0.7 / 5.0, rtol=1e-6)


def test_what_grid_and_closure_cannot_represent_is_added_and_is_not_informed():
    grid, closure = np.full(SHAPE, 0.3), np.full(SHAPE, -0.2)
    represented = Represented(grid, closure, 2.0, (0.5, 0.4, 0.1))

    nothing, one = np.zeros((1, *SHAPE)), np.ones((1, *SHAPE))
    alone = deviation(nothing, nothing, np.eye(1), represented)
    with_one = deviation(one, one, np.array([[0.25]]), represented)

    # Even fields stay even under smoothing: the three terms add, the parameter's variance joins them.
    assert alone.std.max() == pytest.approx(0.5 * 0.3 + 0.4 * 0.2 + 0.1 * 2.0, rel=1e-6)
    assert alone.informed.max() == 0
    np.testing.assert_allclose(with_one.std**2, alone.std**2 + 0.25, rtol=1e-6)
    assert 0 < with_one.informed.min() < 0.75
