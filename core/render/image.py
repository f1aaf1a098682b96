"""Rendered images: the reference, and the one with flow, at the same sample positions.

    I_j = sum_s w_s L(c(s) + shift(s)) cos / r        (paper, eq. 2)

A zero field gives exactly the reference, bit for bit: both go through the same arithmetic.
"""

from functools import lru_cache

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from core.fields import AbstractField
from core.pattern import make_pattern
from core.rays.straight import StraightTracer
from core.rays.tracer import AbstractRayTracer
from core.render.geometry import PixelGeometry, pixel_geometry
from core.render.light import pattern_size, sample_pattern
from core.render.pixel_filter import quadrature
from core.render.shift import pattern_offset_px, wall_offset_m
from core.scene import Pattern, Scene

_RAYS_A_BLOCK = 2**18
_STEPS = 64
_SAMPLES = 4


def render_reference(scene: Scene, view: int = 0) -> Float32[np.ndarray, "rows cols"]:
    """Luminance of the pattern through air at rest, about 0 to 1."""
    return _render(scene, view, None)


def render_flow(scene: Scene, field: AbstractField, view: int = 0) -> Float32[np.ndarray, "rows cols"]:
    """Luminance of the pattern through the flow, about 0 to 1."""
    return _render(scene, view, field)


def _render(scene: Scene, view: int, field: AbstractField | None) -> Float32[np.ndarray, "rows cols"]:
    camera = scene.views[view].camera
    pattern = jnp.asarray(_pattern(scene.light.pattern, *pattern_size(scene)))
    tracer = StraightTracer(_STEPS, scene.air.ambient_refractivity)
    rows_a_block = max(1, _RAYS_A_BLOCK // camera.width_px)
    image = np.zeros((camera.height_px, camera.width_px), np.float32)
    for first in range(0, camera.height_px, rows_a_block):
        rows = min(rows_a_block, camera.height_px - first)
        row, column = np.mgrid[first : first + rows, 0 : camera.width_px]
        pixels = np.stack([column.ravel(), row.ravel()], axis=1).astype(float)
        geometry = pixel_geometry(scene, view, pixels)
        shift_px = jnp.zeros_like(geometry.fraction_px) if field is None else _shift(geometry, field, tracer)
        image[first : first + rows] = np.asarray(_expose(pattern, geometry, shift_px)).reshape(rows, -1)
    return image


@eqx.filter_jit
def _shift(
    geometry: PixelGeometry, field: AbstractField, tracer: AbstractRayTracer
) -> Float[Array, "rays 2"]:
    return pattern_offset_px(geometry, wall_offset_m(geometry, field, tracer))


@eqx.filter_jit
def _expose(
    pattern: Float[Array, "rows cols"], geometry: PixelGeometry, shift_px: Float[Array, "rays 2"]
) -> Float[Array, " rays"]:
    """Filter the pattern over the pixel; the samples of a pixel share its ray's shift."""
    offsets, weights = quadrature(_SAMPLES)
    total = jnp.zeros_like(geometry.weight)
    for offset, weight in zip(offsets, weights, strict=True):
        step_px = geometry.pattern_from_pixel @ jnp.asarray(offset, jnp.float32)
        place_px = geometry.fraction_px + step_px + shift_px
        total = total + float(weight) * sample_pattern(pattern, geometry.cell, place_px)
    return total * geometry.weight


@lru_cache(maxsize=2)
def _pattern(pattern: Pattern, rows: int, cols: int) -> Float32[np.ndarray, "rows cols"]:
    return make_pattern(pattern, rows, cols)
