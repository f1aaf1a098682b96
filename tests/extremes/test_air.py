"""Air from a thousandth of a kelvin to a flame, and what is no air."""

import jax
import jax.numpy as jnp

from core.air import Air, gladstone_dale_m3_kg
from tests.extremes.row import Near, Refused, Row, Within, extremes, prove

AIR = Air()
N0, T0 = AIR.ambient_refractivity, AIR.ambient_temperature_k


def excess(kelvin: float) -> Row:
    """N(T0 + dT) - N0 in float32 against its formula in float64: no cancellation at any contrast."""
    exact = -N0 * kelvin / (T0 + kelvin)
    return Row(
        "air",
        f"excess of {kelvin:g} K, float32",
        lambda: AIR.excess_refractivity(jnp.array([kelvin], jnp.float32)),
        Near(exact, rel=4e-7),
    )


def there_and_back(kelvin: float) -> Row:
    return Row(
        "air",
        f"{kelvin:g} K to refractivity and back, float32",
        lambda: AIR.temperature_k(AIR.refractivity(jnp.array([kelvin], jnp.float32))),
        Near(kelvin, rel=3e-7),
    )


def difference(kelvin: float) -> Row:
    """What a float32 index near 1 would lose: the excess is the difference of two refractivities."""

    def minus() -> jax.Array:
        with jax.enable_x64(True):
            return AIR.refractivity(jnp.array([T0 + kelvin])) - AIR.refractivity(jnp.array([T0]))

    name = f"refractivity of T0 + {kelvin:g} K minus that of T0, float64"
    return Row("air", name, minus, Near(-N0 * kelvin / (T0 + kelvin), rel=1e-9, abs=1e-18))


def refused(name: str, words: str, **settings: float) -> Row:
    return Row("air", name, lambda: Air(**settings).ambient_refractivity, Refused(words))


ROWS = [
    *[excess(k) for k in (1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 500.0, 2000.0)],
    *[excess(-k) for k in (1e-3, 0.1, 10.0, 100.0, 143.15)],
    Row("air", "T = T0", lambda: AIR.excess_refractivity(jnp.zeros(3)), Near(0.0)),
    *[there_and_back(k) for k in (150.0, 293.15, 2500.0)],
    *[difference(k) for k in (1e-3, 1.0, 2000.0)],
    # Edlen's N at 15 C, 1013.25 hPa, 589 nm is 2.769e-4; Ciddor's G here is of dry air.
    Row(
        "air",
        "15 C at 589 nm against Edlen",
        lambda: Air(ambient_temperature_k=288.15, wavelength_m=589e-9).ambient_refractivity,
        Near(2.77e-4, rel=2e-3),
    ),
    Row("air", "thin air, 1e4 Pa", lambda: Air(pressure_pa=1e4).density_kg_m3, Near(0.11884, rel=1e-3)),
    Row("air", "10 bar", lambda: Air(pressure_pa=1e6).density_kg_m3, Near(11.884, rel=1e-3)),
    Row("air", "beyond the table's colours", lambda: gladstone_dale_m3_kg(2e-6), Within(2.2e-4, 2.3e-4)),
    refused("pressure in hPa", "1013.25 hPa is 101325 Pa", pressure_pa=1013.25),
    refused("pressure in kPa", "pascal", pressure_pa=101.325),
    refused("no pressure", "pascal", pressure_pa=0.0),
    refused("ambient in Celsius", "Celsius", ambient_temperature_k=20.0),
    refused("ambient at absolute zero", "kelvin", ambient_temperature_k=0.0),
    refused("ambient not a number", "kelvin", ambient_temperature_k=float("nan")),
    refused("wavelength in nm", "600 nm is 600e-9", wavelength_m=600.0),
    refused("wavelength in um", "metres", wavelength_m=0.6),
    refused("Gladstone-Dale in cm3/g", "2.26e-4", gladstone_dale=0.226),
    refused("Gladstone-Dale zero", "2.26e-4", gladstone_dale=0.0),
    refused("viscosity in mm2/s", "15 mm2/s", kinematic_viscosity_m2_s=15.0),
    refused("viscosity zero", "m2/s", kinematic_viscosity_m2_s=0.0),
    refused("Prandtl zero", "0.71", prandtl=0.0),
]


@extremes(ROWS)
def test_air_at_its_limits(row: Row, record_property):
    prove(row, record_property)
