import jax.numpy as jnp
import pytest

from core.air import Air, gladstone_dale_m3_kg
from core.setting import SettingError


def test_density_follows_the_ideal_gas_law():
    assert Air().density_kg_m3 == pytest.approx(1.2041, rel=1e-4)


def test_gladstone_dale_matches_the_table_between_and_at_its_points():
    assert gladstone_dale_m3_kg(532e-9) == pytest.approx(2.270e-4, rel=1e-6)
    assert 2.257e-4 < gladstone_dale_m3_kg(610e-9) < 2.262e-4


def test_excess_refractivity_keeps_float32_digits_at_a_hundredth_of_a_kelvin():
    air = Air()
    excess_k = jnp.float32(0.01)

    small = float(air.excess_refractivity(excess_k))

    exact = -air.ambient_refractivity * 0.01 / (air.ambient_temperature_k + 0.01)
    # Differences of eta or N in float32 would be wrong in the first digit; this form is good to rounding.
    assert small == pytest.approx(exact, rel=1e-6)


def test_temperature_inverts_refractivity():
    air = Air()
    assert float(air.temperature_k(air.refractivity(jnp.float32(310.0)))) == pytest.approx(310.0, rel=1e-6)


@pytest.mark.parametrize(
    ("wrong", "hint"),
    [
        ({"ambient_temperature_k": 20.0}, "kelvin"),
        ({"pressure_pa": 1013.25e-3}, "pascal"),
        ({"wavelength_m": 600.0}, "metres"),
    ],
)
def test_unit_mistakes_are_named(wrong, hint):
    with pytest.raises(SettingError, match=hint):
        Air(**wrong)
