import numpy as np

from core.estimate.uncertainty import deviation

SHAPE = (6, 5, 7)


def test_parameters_spread_by_their_posterior_and_inform_where_it_is_narrow():
    warmer, stronger = np.ones(SHAPE), np.zeros(SHAPE)
    stronger[3:] = 2.0
    # Prior variances are 1; the second parameter is halved in deviation, and they go against one another.
    covariance = np.array([[0.5, -0.2], [-0.2, 0.25]])

    slopes = np.stack([warmer, stronger])
    found = deviation(slopes, covariance, 0.0)

    np.testing.assert_allclose(found.std[:3] ** 2, 0.5, rtol=1e-6)
    np.testing.assert_allclose(found.std[3:] ** 2, 0.5 + 4 * 0.25 + 2 * 2 * -0.2, rtol=1e-6)
    np.testing.assert_allclose(found.informed[:3], 0.5, rtol=1e-6)
    np.testing.assert_allclose(found.informed[3:], 1 - 0.7 / 5.0, rtol=1e-6)


def test_what_the_model_has_wrong_is_added_and_is_not_informed():
    nothing, one = np.zeros((1, *SHAPE)), np.ones((1, *SHAPE))
    alone = deviation(nothing, np.eye(1), np.full(SHAPE, 0.4))
    with_one = deviation(one, np.array([[0.25]]), np.full(SHAPE, 0.4))

    np.testing.assert_allclose(alone.std, 0.4, rtol=1e-6)
    assert alone.informed.max() == 0
    np.testing.assert_allclose(with_one.std**2, 0.4**2 + 0.25, rtol=1e-6)
    assert 0 < with_one.informed.min() < 0.75
