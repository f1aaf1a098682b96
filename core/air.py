"""Air as light sees it: temperature to refractivity (paper, section II-A).

    eta = 1 + G rho        eta(T) = 1 + rho0 G T0 / T   (nearly constant pressure)

Only the refractivity N = eta - 1 is ever stored: near 1.0 a float32 step is 1.2e-7, and 1 K moves
eta by 9.3e-7, eight steps.
"""

import numpy as np
from jaxtyping import Array, Float

from core.setting import check_range, setting

GAS_CONSTANT_DRY_AIR_J_KG_K = 287.05
GRAVITY_M_S2 = 9.81
HEAT_CAPACITY_J_KG_K = 1006.0

# Ciddor (1996), dry air: wavelength [m], Gladstone-Dale coefficient [m3/kg].
_GLADSTONE_DALE = np.array(
    [
        [405e-9, 2.305e-4],
        [450e-9, 2.289e-4],
        [532e-9, 2.270e-4],
        [589e-9, 2.262e-4],
        [633e-9, 2.257e-4],
        [850e-9, 2.242e-4],
    ]
)


def gladstone_dale_m3_kg(wavelength_m: float) -> float:
    """Gladstone-Dale coefficient G of dry air, interpolated in 1 / wavelength^2 (Cauchy's form)."""
    table = _GLADSTONE_DALE[::-1]
    return float(np.interp(wavelength_m**-2, table[:, 0] ** -2, table[:, 1]))


@setting
class Air:
    """The room's air at rest: what the reference image was taken in.

    `gladstone_dale` in m3/kg overrides the value that follows from the wavelength.
    """

    pressure_pa: float = 101_325.0
    """The room's air pressure, of a barometer."""
    ambient_temperature_k: float = 293.15
    """Temperature of the still air before the reference picture."""
    wavelength_m: float = 600e-9
    """The light that the camera sees; the middle of it where it is white."""
    gladstone_dale: float | None = None
    """Gladstone-Dale coefficient [m3/kg]; without it, that of dry air at the wavelength."""
    kinematic_viscosity_m2_s: float = 1.5e-5
    """Of the air, without turbulence."""
    prandtl: float = 0.71
    """Viscosity over thermal diffusivity of the air."""

    def __post_init__(self) -> None:
        check_range(
            "Air pressure", self.pressure_pa, 1e4, 1e6, "Pa",
            "Give pressure_pa in pascal (1013.25 hPa is 101325 Pa).",
        )  # fmt: skip
        check_range(
            "Ambient temperature", self.ambient_temperature_k, 150.0, 2500.0, "K",
            "Give ambient_temperature_k in kelvin (20 degrees Celsius is 293.15 K).",
        )  # fmt: skip
        check_range(
            "Wavelength", self.wavelength_m, 200e-9, 2e-6, "m",
            "Give wavelength_m in metres (600 nm is 600e-9 m).",
        )  # fmt: skip
        if self.gladstone_dale is not None:
            check_range(
                "The Gladstone-Dale coefficient", self.gladstone_dale, 1e-5, 1e-2, "m3/kg",
                "Give gladstone_dale in m3/kg (dry air has 2.26e-4).",
            )  # fmt: skip
        check_range(
            "Kinematic viscosity", self.kinematic_viscosity_m2_s, 1e-7, 1e-2, "m2/s",
            "Give kinematic_viscosity_m2_s in m2/s (air at 20 C has 1.5e-5; 15 mm2/s is 1.5e-5).",
        )  # fmt: skip
        check_range("The Prandtl number", self.prandtl, 1e-3, 1e4, "", "Air has 0.71.")

    @property
    def density_kg_m3(self) -> float:
        """Ambient density rho0 by the ideal gas law."""
        return self.pressure_pa / (GAS_CONSTANT_DRY_AIR_J_KG_K * self.ambient_temperature_k)

    @property
    def ambient_refractivity(self) -> float:
        """N0 = rho0 G: refractivity of the air at rest (2.72e-4 at 20 C)."""
        coefficient = self.gladstone_dale or gladstone_dale_m3_kg(self.wavelength_m)
        return self.density_kg_m3 * coefficient

    @property
    def heat_capacity_j_m3_k(self) -> float:
        """Heat capacity of a cubic metre of the air at rest."""
        return self.density_kg_m3 * HEAT_CAPACITY_J_KG_K

    @property
    def expansion_per_k(self) -> float:
        """Coefficient of thermal expansion beta = 1 / T0 of an ideal gas."""
        return 1.0 / self.ambient_temperature_k

    def refractivity(self, temperature_k: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """N(T) = N0 T0 / T."""
        return self.ambient_refractivity * self.ambient_temperature_k / temperature_k

    def excess_refractivity(self, excess_k: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """N(T0 + excess) - N0 = -N0 excess / (T0 + excess): exact, without cancellation at small excess."""
        return -self.ambient_refractivity * excess_k / (self.ambient_temperature_k + excess_k)

    def temperature_k(self, refractivity: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """The inverse of `refractivity`: T = N0 T0 / N."""
        return self.ambient_refractivity * self.ambient_temperature_k / refractivity
