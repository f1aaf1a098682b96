"""How far the flow moves the pattern coordinate that a sensor position sees."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from core.fields import AbstractField
from core.rays.bundle import Rays
from core.rays.tracer import AbstractRayTracer
from core.render.pixel_geometry import PixelGeometry


def wall_offset_m(
    geometry: PixelGeometry, field: AbstractField, tracer: AbstractRayTracer, projector_order: int = 1
) -> Float[Array, "rays 3"]:
    """Wall point whose undisturbed light is seen, minus the undisturbed wall point.

    Print: delta_C, the camera ray's shift. Projector: its light bends too. The wall point w = w0 + delta_C
    is lit by the ray aimed at a, where a + delta_P(a) = w. First order: a = w - delta_P(w0). Every further
    order is one Picard step a <- w - delta_P(a), for the price of one trace.
    """
    seen_m = tracer.bend(geometry.camera, field).wall_shift_m
    if geometry.projector is None or geometry.projector_range_m is None:
        return seen_m
    offset_m = jnp.zeros_like(seen_m)
    for _ in range(projector_order):
        aimed = aim(geometry.projector, offset_m, geometry.projector_range_m)
        offset_m = seen_m - tracer.bend(aimed, field).wall_shift_m
    return offset_m


def pattern_offset_px(geometry: PixelGeometry, offset_m: Float[Array, "rays 3"]) -> Float[Array, "rays 2"]:
    """Move of the pattern coordinate (column, row) for a move on the wall: exact for a pinhole.

    With lens distortion its local slope is used: an error of (move / feature of the lens) squared.
    """
    linear = jnp.einsum("rij,rj->ri", geometry.pattern_from_wall, offset_m)
    return linear / (1.0 + jnp.sum(geometry.depth_slope * offset_m, axis=-1, keepdims=True))


def aim(rays: Rays, offset_m: Float[Array, "rays 3"], range_m: Float[Array, " rays"]) -> Rays:
    """The same lens's rays, aimed at wall points moved by `offset_m`, which lies in the wall."""
    tilted = rays.direction + offset_m / range_m[:, None]
    stretch = jnp.sqrt(jnp.sum(tilted * tilted, axis=-1))
    outside = (1.0 - rays.length_m / range_m)[:, None]
    return Rays(
        entry_m=rays.entry_m + outside * offset_m,
        direction=tilted / stretch[:, None],
        length_m=rays.length_m * stretch,
        outcome=jax.lax.stop_gradient(rays.outcome),
    )
