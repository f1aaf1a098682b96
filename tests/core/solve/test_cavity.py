"""The residuals of grid and network against a published benchmark: the heated cavity of de Vahl Davis (1983)."""

import jax
import pytest

from tests.core.solve.cavity import NUSSELT, numbers, nusselts
from tests.core.solve.cavity_network import cavity_terms, descended, nusselt, start


def test_the_heated_cavity_has_the_published_nusselt_numbers():
    with jax.enable_x64(True):
        coarse, fine = nusselts(16), nusselts(24)
    for rayleigh, published in NUSSELT.items():
        order_two = fine[rayleigh] + (fine[rayleigh] - coarse[rayleigh]) / ((24 / 16) ** 2 - 1)
        # Richardson's extrapolation of the second-order scheme; measured 0.0, 0.1 and 0.6 %.
        assert order_two == pytest.approx(published, rel=0.01)
        # And the grid is what makes the difference: it falls with the square of the cells' size.
        assert abs(fine[rayleigh] / published - 1) < 0.55 * abs(coarse[rayleigh] / published - 1)


def test_a_network_finds_the_heated_cavity_too():
    with jax.enable_x64(True):
        given = numbers(1e3)
        network, loss = descended(start(12), cavity_terms(14), given, steps=60)
        found = nusselt(network, given)
    assert loss < 1e-3  # mean square of the residuals, of terms of order one
    # The 3 %; conduction alone, where a lazy network ends, has 1 instead of 1.118.
    assert found == pytest.approx(NUSSELT[1e3], rel=0.03)
