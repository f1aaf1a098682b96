import numpy as np
import pytest

from core.room.fit import gauss_newton


def test_the_closure_is_not_let_go_in_a_wrong_supplys_place():
    # Data that see only the sum of two parameters, a supply and the closure's viscosity: ten deviations away.
    jacobian, residual, variance = np.ones((8, 2)), np.zeros(8), np.ones(8)

    def moved(firm: list[bool]) -> np.ndarray:
        return gauss_newton(np.array([5.0, 5.0]), residual, variance, jacobian, np.array(firm)).vector

    # Were both priors Student's, nothing would tell the two apart.
    same = moved([False, False])
    assert same[0] == pytest.approx(same[1])
    # A firm one pulls as far as one step may go (three deviations), and the supply takes it up.
    entry, closure = moved([False, True])
    assert closure == pytest.approx(2.0)
    assert entry > 7.0


def test_where_all_are_trusted_both_move_alike():
    jacobian, residual, variance = np.ones((8, 2)), np.full(8, 2.0), np.ones(8)

    found = gauss_newton(np.zeros(2), residual, variance, jacobian, np.array([False, True]), trusting=True)

    # 8 (2 - a - b) = a = b.
    assert found.vector == pytest.approx(np.full(2, 16.0 / 17.0))
