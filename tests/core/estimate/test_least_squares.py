import numpy as np
import pytest

from core.estimate.least_squares import beyond_noise, gauss_newton, weighted_variance
from core.estimate.parameter_step import secant


def test_the_closure_is_not_let_go_in_a_wrong_supplys_place():
    # Data that see only the sum of two parameters, a supply and the closure's viscosity: ten deviations away.
    jacobian, residual, variance = np.ones((8, 2)), np.zeros(8), np.ones(8)

    def moved(gaussian: list[bool]) -> np.ndarray:
        return gauss_newton(np.array([5.0, 5.0]), residual, variance, jacobian, np.array(gaussian)).vector

    # Were both priors Student's, nothing would tell the two apart.
    same = moved([False, False])
    assert same[0] == pytest.approx(same[1])
    # A gaussian one pulls as far as one step may go (three deviations), and the supply takes it up.
    entry, closure = moved([False, True])
    assert closure == pytest.approx(2.0)
    assert entry > 7.0


def test_where_all_are_trusted_both_move_alike():
    jacobian, residual, variance = np.ones((8, 2)), np.full(8, 2.0), np.ones(8)

    found = gauss_newton(np.zeros(2), residual, variance, jacobian, np.array([True, True]))

    # 8 (2 - a - b) = a = b.
    assert found.vector == pytest.approx(np.full(2, 16.0 / 17.0))


def test_a_damped_step_keeps_parameters_together_that_make_up_for_one_another():
    # Data that see the difference of two parameters ten times better than their sum, both 50 deviations away.
    jacobian = np.array([[10.0, -10.0], [1.0, 1.0]])
    residual, variance = np.array([0.0, 100.0]), np.full(2, 1e-4)

    def step(reach: float) -> np.ndarray:
        gaussian = np.array([True, True])
        return gauss_newton(np.zeros(2), residual, variance, jacobian, gaussian, trust_radius=reach).vector

    near, far = step(0.5), step(2.0)
    for reached, reach in ((near, 0.5), (far, 2.0)):
        assert 0.4 * reach < np.abs(reached).max() <= reach
        assert reached[0] == pytest.approx(reached[1], rel=1e-3)


def test_a_march_teaches_the_jacobian_its_own_move_and_nothing_else():
    jacobian = np.arange(6.0).reshape(3, 2)
    moved, change = np.array([1.0, 1.0]), np.array([4.0, 0.0, -2.0])

    learned = secant(jacobian, moved, change)

    np.testing.assert_allclose(learned @ moved, change)
    across = np.array([1.0, -1.0])
    np.testing.assert_allclose(learned @ across, jacobian @ across)


def test_far_from_the_truth_a_thermometer_holds_against_images_that_the_room_does_not_explain():
    # One parameter; ten shifts ask for 3, a thermometer for -2, and two grids agree to a tenth.
    group = np.array([0] * 10 + [4])
    residual = np.where(group == 0, 3.0, -2.0)
    noise, grids, alike = np.full(11, 1e-4), np.full(11, 0.1), np.where(group == 0, 12.0, 1.0)

    def step(*, far: bool) -> float:
        variance = weighted_variance(noise, alike, group, residual, grids, far=far)
        found = gauss_newton(np.zeros(1), residual, variance, np.ones((11, 1)), np.array([True]))
        return float(found.vector[0])

    assert step(far=False) > -1.0
    assert step(far=True) == pytest.approx(-2.0, abs=0.1)


def test_noise_is_each_datums_own_and_what_a_model_has_wrong_is_shared():
    group, alike = np.zeros(1000, int), np.full(1000, 40.0)
    residual = 0.3 * np.random.default_rng(0).normal(size=1000)

    variance = weighted_variance(np.full(1000, 0.01), alike, group, residual, np.full(1000, 1.0))

    np.testing.assert_allclose(variance, 0.01 + 40.0 * (0.3**2 - 0.01), rtol=0.1)


@pytest.mark.parametrize("uneven", [0.0, 0.5])
@pytest.mark.parametrize("wrong", [0.0, 0.25, 1.0, 25.0])
def test_what_a_model_has_wrong_is_told_from_noise_even_or_not(wrong: float, uneven: float):
    draw = np.random.default_rng(0)
    variance = np.exp(2.0 * uneven * draw.normal(size=20_000))
    values = draw.normal(size=20_000) * np.sqrt(variance + wrong)

    assert beyond_noise(values, variance) == pytest.approx(wrong, rel=0.05, abs=0.03)
    # A twentieth of edges of jets does not count as itself.
    values[::40] = 1e3
    assert beyond_noise(values, variance) < 1.3 * wrong + 0.2


def test_of_a_few_values_none_is_passed_over():
    assert beyond_noise(np.array([0.01, 1.0]), np.full(2, 1e-4)) == pytest.approx(0.5, rel=1e-3)
    assert beyond_noise(np.zeros(3), np.zeros(3)) == 0.0
