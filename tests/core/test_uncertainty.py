import numpy as np
import pytest

from core.uncertainty import deviation

SHAPE = (6, 5, 7)
NOTHING = (np.zeros(SHAPE), np.zeros(SHAPE))


def test_parameters_spread_by_their_posterior_and_inform_where_it_is_narrow():
    warmer, stronger = np.ones(SHAPE), np.zeros(SHAPE)
    stronger[3:] = 2.0
    # Prior variances are 1; the second parameter is halved in deviation, and they go against one another.
    covariance = np.array([[0.5, -0.2], [-0.2, 0.25]])

    found = deviation([warmer, stronger], covariance, NOTHING, 0.0)

    np.testing.assert_allclose(found.std[:3] ** 2, 0.5, rtol=1e-6)
    np.testing.assert_allclose(found.std[3:] ** 2, 0.5 + 4 * 0.25 + 2 * 2 * -0.2, rtol=1e-6)
    np.testing.assert_allclose(found.informed[:3], 0.5, rtol=1e-6)
    np.testing.assert_allclose(found.informed[3:], 1 - 0.7 / 5.0, rtol=1e-6)


def test_what_grid_and_closure_cannot_represent_is_added_and_is_not_informed():
    grid, closure = np.full(SHAPE, 0.3), np.full(SHAPE, -0.2)

    bare = deviation([], np.zeros((0, 0)), NOTHING, 1.0)
    wider = deviation([], np.zeros((0, 0)), (grid, closure), 1.0)

    assert bare.std.min() == pytest.approx(bare.std.max())
    assert bare.std.min() > 0
    assert wider.std.min() > bare.std.max()
    assert wider.informed.max() == 0
