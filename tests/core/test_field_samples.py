import numpy as np
import pytest

from core.field_samples import samples
from core.result import Solution

AXIS = np.linspace(0.0, 2.0, 9)
SHAPE = (9, 9, 9)


def found(**deviations) -> Solution:
    return Solution(AXIS, AXIS, AXIS, np.full(SHAPE, 293.0), velocity_m_s=np.zeros((*SHAPE, 3)), **deviations)


def test_samples_scatter_by_the_stated_deviation_everywhere():
    std_k = np.linspace(0.1, 1.0, 9)[:, None, None] * np.ones(SHAPE)
    drawn = np.array([s.temperature_k for s in samples(found(temperature_std_k=std_k), 400, 0.5)])
    # 400 samples tell a deviation to 3.5 %; five of those.
    np.testing.assert_allclose(drawn.std(axis=0), std_k, rtol=0.18)
    assert drawn.mean() == pytest.approx(293.0, abs=0.03)


def test_places_go_together_over_the_stated_length():
    solution = found(velocity_std_m_s=np.ones((*SHAPE, 3)))
    drawn = np.array([s.velocity_m_s for s in samples(solution, 400, 0.5)])
    middle = drawn[:, 3, 4, 4, 0]
    # exp(-d^2 / (2 x 0.5^2)) at 0.5 m and at 1 m along x; 400 pairs tell a correlation to 0.05.
    assert np.corrcoef(middle, drawn[:, 5, 4, 4, 0])[0, 1] == pytest.approx(np.exp(-0.5), abs=0.15)
    assert np.corrcoef(middle, drawn[:, 7, 4, 4, 0])[0, 1] == pytest.approx(np.exp(-2.0), abs=0.2)
    assert np.corrcoef(middle, drawn[:, 3, 4, 4, 1])[0, 1] == pytest.approx(0.0, abs=0.2)


def test_an_error_that_all_places_share_moves_them_together():
    std_k, shared_k = np.full(SHAPE, 0.5), np.full((*SHAPE, 1), 0.4)
    solution = found(temperature_std_k=std_k, temperature_shared_k=shared_k)
    drawn = np.array([s.temperature_k for s in samples(solution, 400, 0.25)])
    # 0.4^2 of 0.5^2 is common; the corners are 14 lengths apart.
    assert np.corrcoef(drawn[:, 0, 0, 0], drawn[:, 8, 8, 8])[0, 1] == pytest.approx(0.64, abs=0.1)
    np.testing.assert_allclose(drawn.std(axis=0), std_k, rtol=0.18)


def test_what_has_no_deviation_does_not_move():
    (drawn,) = samples(found(), 1, 0.5)
    np.testing.assert_array_equal(drawn.temperature_k, 293.0)
    np.testing.assert_array_equal(drawn.velocity_m_s, 0.0)


def test_the_same_seed_draws_the_same():
    solution = found(temperature_std_k=np.ones(SHAPE))
    one, other = (next(samples(solution, 1, 0.5, seed=3)).temperature_k for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_a_wall_that_lets_nothing_through_is_shut_in_every_sample():
    solution = found(velocity_std_m_s=np.ones((*SHAPE, 3)))
    solution.velocity_m_s[0, 4, 4, 0] = 0.1
    (drawn,) = samples(solution, 1, 0.5)
    assert np.count_nonzero(drawn.velocity_m_s[0, ..., 0]) == 1
    assert not drawn.velocity_m_s[..., -1, 2].any()
