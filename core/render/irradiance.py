"""The shadowgraph term: how refraction gathers or spreads the projector's light on the wall."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.fields import AbstractField
from core.rays.bundle import Rays
from core.rays.tracer import AbstractRayTracer
from core.render.pixel_geometry import PixelGeometry
from core.render.shift import aim

_PROBE_M = 2e-3


def irradiance_factor(
    geometry: PixelGeometry,
    field: AbstractField,
    tracer: AbstractRayTracer,
    offset_m: Float[Array, "rays 3"],
) -> Float[Array, " rays"]:
    """Light on the wall over the light without flow: det d a / d w, a the point that the light was aimed at.

    The ray aimed at a lands on w = a + delta_P(a), so the factor is 1 / det(1 + d delta_P / d a), here
    by central differences of four rays around each: it conserves the light on the wall. To first order
    it is 1 - div delta_P. 1 for a print. Cost: four traces.
    """
    if geometry.projector is None or geometry.projector_range_m is None:
        return jnp.ones_like(geometry.weight)
    projector, range_m = geometry.projector, geometry.projector_range_m

    def landing(probe_m: Float[Array, "3"]) -> Float[Array, "rays 3"]:
        aimed: Rays = aim(projector, offset_m + probe_m[None], range_m)
        return tracer.bend(aimed, field).wall_shift_m

    probes_m = _PROBE_M * jnp.asarray([[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]], offset_m.dtype)
    right, left, up, down = jax.lax.map(landing, probes_m)
    along_x, along_z = (right - left) / (2 * _PROBE_M), (up - down) / (2 * _PROBE_M)
    # det(1 + D) - 1 first: near 1, a float32 has lost the digits of a small D.
    small = along_x[:, 0] + along_z[:, 2] + along_x[:, 0] * along_z[:, 2] - along_x[:, 2] * along_z[:, 0]
    return 1.0 / (1.0 + small)
