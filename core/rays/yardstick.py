"""What the tracers are measured against: the coupled ray equation in float64, to a tight tolerance."""

from typing import Any, cast

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from core.fields import AbstractField
from core.rays.bundle import Rays


def exact_wall_shift_m(
    rays: Rays, field: AbstractField, ambient_refractivity: float = 0.0, relative_tolerance: float = 1e-11
) -> Float[np.ndarray, "rays 3"]:
    """Wall shift of rays that reach the back wall, for a smooth field; call it under `jax.enable_x64`.

    Integrates over y instead of s, so that the wall is reached exactly:

        d delta / dy = w / w_y - d / d_y,        dw / dy = (1 + m) grad m / w_y

    by Dormand & Prince's eighth-order pair with step control, the whole batch as one state (a step
    is as small as its hardest ray needs; reverse-mode through a vmapped solve would hold one field a ray).
    Rays need float64 and an advance along y.
    """
    middle_m = rays.entry_m + 0.5 * rays.length_m[:, None] * rays.direction
    size = jnp.maximum(jnp.max(jnp.abs(field.excess(middle_m))), 1e-12)
    return np.asarray(_solve(rays, field, 1.0 / (1.0 + ambient_refractivity), relative_tolerance, size))


@eqx.filter_jit
def _solve(rays: Rays, field: AbstractField, scale: float, tolerance: float, size: Array) -> Array:
    slope = rays.direction / rays.direction[:, 1:2]
    depth_m = (rays.length_m * rays.direction[:, 1])[:, None]

    def rate(share: Any, state: PyTree, _: PyTree) -> tuple[Array, Array]:
        deviation_m, turn = state
        heading = rays.direction + turn
        points_m = rays.entry_m + share * depth_m * slope + deviation_m
        excess, gradient = field.excess_and_gradient(points_m)
        force = gradient * (scale * (1.0 + scale * excess))[:, None]
        # w / w_y - d / d_y without the difference of two numbers near 1.
        drift = (turn - turn[:, 1:2] * slope) / heading[:, 1:2]
        return depth_m * drift, depth_m * force / heading[:, 1:2]

    start = (field.excess(rays.entry_m) * scale)[:, None] * rays.direction
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        diffrax.Dopri8(),
        t0=0.0,
        t1=1.0,
        dt0=0.01,
        y0=(jnp.zeros_like(start), start),
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance * size),
        max_steps=100_000,
    )
    deviations_m, _ = cast(tuple[Array, Array], solution.ys)
    return deviations_m[-1]
