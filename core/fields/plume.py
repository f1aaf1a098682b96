"""A warm plume in closed form: the yardstick's test object."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.air import Air
from core.fields.formula import FunctionField
from core.geometry import Vector3


class _Plume(eqx.Module):
    air: Air = eqx.field(static=True)
    peak_k: float | Float[Array, ""]
    centre_m: Vector3 = eqx.field(static=True)
    radius_m: float = eqx.field(static=True)

    def __call__(self, point_m: Float[Array, "3"]) -> Float[Array, ""]:
        away = (point_m - jnp.asarray(self.centre_m, point_m.dtype)) / self.radius_m
        # Twice as tall as wide.
        squared = away[0] ** 2 + away[1] ** 2 + away[2] ** 2 / 4.0
        return self.air.excess_refractivity(self.peak_k * jnp.exp(-0.5 * squared))


def plume(air: Air, *, peak_k: float | Float[Array, ""], centre_m: Vector3, radius_m: float) -> FunctionField:
    """Excess temperature `peak_k` exp(-r^2 / 2), r in units of `radius_m` across and twice that upwards."""
    return FunctionField(_Plume(air, peak_k, centre_m, radius_m))
