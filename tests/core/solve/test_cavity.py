"""The grid's residuals against a published benchmark: the heated cavity of de Vahl Davis (1983)."""

import jax
import pytest

from tests.core.solve.cavity import NUSSELT, nusselts


def test_the_heated_cavity_has_the_published_nusselt_numbers():
    with jax.enable_x64(True):
        coarse, fine = nusselts(16), nusselts(24)
    for rayleigh, published in NUSSELT.items():
        order_two = fine[rayleigh] + (fine[rayleigh] - coarse[rayleigh]) / ((24 / 16) ** 2 - 1)
        # Richardson's extrapolation of the second-order scheme; measured 0.0, 0.1 and 0.6 %.
        assert order_two == pytest.approx(published, rel=0.01)
        # And the grid is what makes the difference: it falls with the square of the cells' size.
        assert abs(fine[rayleigh] / published - 1) < 0.55 * abs(coarse[rayleigh] / published - 1)
