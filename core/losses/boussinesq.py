"""The paper's residuals of buoyant air, dimensionless, and the scales that make them so.

    mass      ∇·u = 0
    momentum  (u·∇)u + ∇p − ∇²u / Re + Ri T e_g = 0        e_g along gravity
    heat      (u·∇)T − ∇²T / Pe = 0                        T = (temperature − T0) / excess scale

Source: extended abstract, section II-D. Written for one point; `jax.vmap` at the call. A Reynolds
average obeys the same form with effective coefficients: Re and Pe are then those of ν + ν_t.
"""

import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.air import GRAVITY_M_S2, Air
from core.setting import SettingError, setting

# Least scales: still air or an isothermal inlet would give zero.
EXCESS_FLOOR_K = 0.1
VELOCITY_FLOOR_M_S = 0.01


class FlowValues(eqx.Module):
    """T, p, u at points, or one of their derivatives: the derivative's axes come last."""

    temperature: Float[Array, "..."]
    pressure: Float[Array, "..."]
    velocity: Float[Array, "..."]


class Residuals(eqx.Module):
    """What the three equations leave, signed."""

    mass: Float[Array, "..."]
    momentum: Float[Array, "..."]
    heat: Float[Array, "..."]


@setting
class Numbers:
    """Reynolds, Péclet, Richardson; gravity acts along -z. The first two may be traced arrays."""

    reynolds: float | Float[Array, ""]
    peclet: float | Float[Array, ""]
    richardson: float

    def __post_init__(self) -> None:
        if not (isinstance(self.reynolds, float | int) and isinstance(self.peclet, float | int)):
            return  # traced: made from numbers that were checked
        if not (0 < self.reynolds < math.inf and 0 < self.peclet < math.inf):
            raise SettingError(
                f"Re is {self.reynolds:g} and Pe is {self.peclet:g}; expected finite positive numbers. "
                "Give viscosity and diffusivity in m2/s (room air with turbulence: about 1e-3)."
            )


def residuals(value: FlowValues, grad: FlowValues, laplacian: FlowValues, numbers: Numbers) -> Residuals:
    """The residuals at one point; `grad.velocity[i, j]` is the derivative of component i along axis j."""
    u, temperature = value.velocity, value.temperature
    gravity = jnp.array([0.0, 0.0, -1.0], u.dtype)
    return Residuals(
        mass=jnp.trace(grad.velocity),
        momentum=grad.velocity @ u
        + grad.pressure
        - laplacian.velocity / numbers.reynolds
        + numbers.richardson * temperature * gravity,
        heat=grad.temperature @ u - laplacian.temperature / numbers.peclet,
    )


@setting
class Scales:
    """One scale a field: length, speed (one for the whole vector), temperature above `reference_k`."""

    length_m: float
    velocity_m_s: float
    excess_k: float
    reference_k: float

    @property
    def pressure_m2_s2(self) -> float:
        """U², of kinematic pressure."""
        return self.velocity_m_s**2

    def numbers(self, *, viscosity_m2_s: float, diffusivity_m2_s: float, air: Air) -> Numbers:
        """Re, Pe, Ri of these scales."""
        convection = self.velocity_m_s * self.length_m
        buoyancy = GRAVITY_M_S2 * air.expansion_per_k * self.excess_k * self.length_m
        return Numbers(
            reynolds=convection / viscosity_m2_s,
            peclet=convection / diffusivity_m2_s,
            richardson=buoyancy / self.velocity_m_s**2,
        )

    def to_nd(
        self,
        temperature_k: Float[Array, "*points"],
        pressure_m2_s2: Float[Array, "*points"],
        velocity_m_s: Float[Array, "*points 3"],
    ) -> FlowValues:
        """Dimensionless fields."""
        return FlowValues(
            (temperature_k - self.reference_k) / self.excess_k,
            pressure_m2_s2 / self.pressure_m2_s2,
            velocity_m_s / self.velocity_m_s,
        )

    def to_si(
        self, flow: FlowValues
    ) -> tuple[Float[Array, "*points"], Float[Array, "*points"], Float[Array, "*points 3"]]:
        """T [K], p [m2/s2], u [m/s]."""
        return (
            self.reference_k + self.excess_k * flow.temperature,
            self.pressure_m2_s2 * flow.pressure,
            self.velocity_m_s * flow.velocity,
        )


def scales(*, length_m: float, speed_m_s: float, excess_k: float, air: Air) -> Scales:
    """Scales from the largest known speed and excess temperature, with floors.

    The excess keeps its sign (a cold inlet is T_nd = 1 as well) and is at least `EXCESS_FLOOR_K` in
    size. The speed is at least a tenth of the buoyant speed sqrt(g β |excess| L) and at least
    `VELOCITY_FLOOR_M_S`: still air with a heater moves at the buoyant speed.
    """
    if abs(excess_k) < EXCESS_FLOOR_K:
        excess_k = math.copysign(EXCESS_FLOOR_K, excess_k)
    buoyant_m_s = math.sqrt(GRAVITY_M_S2 * air.expansion_per_k * abs(excess_k) * length_m)
    return Scales(
        length_m=length_m,
        velocity_m_s=max(abs(speed_m_s), 0.1 * buoyant_m_s, VELOCITY_FLOOR_M_S),
        excess_k=excess_k,
        reference_k=air.ambient_temperature_k,
    )
