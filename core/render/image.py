"""Whole images in bounded memory: a block of rows at a time, rays shared where the field allows.

A zero field gives exactly the reference, bit for bit: one compiled program exposes both.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from core.fields import AbstractField
from core.render.light import pattern_image
from core.render.pixel_filter import quadrature
from core.render.pixel_geometry import filled, pixel_geometry, shared_count
from core.render.pixels import Exposure, lens_points, pattern_motion
from core.render.render_choice import RenderChoice, choose
from core.scene import Scene
from core.view_frame import facing, field_facing, turn_of

_PIXELS_A_BLOCK = 2**18


def render_reference(scene: Scene, view: int = 0) -> Float32[np.ndarray, "rows cols"]:
    """Luminance of the pattern through air at rest, about 0 to 1: pattern times cos / r over its maximum."""
    return _render(scene, view, None)


def render_flow(scene: Scene, field: AbstractField, view: int = 0) -> Float32[np.ndarray, "rows cols"]:
    """Luminance of the pattern through the flow; `scene.rays` says how rays are traced (`choose`)."""
    return _render(scene, view, field)


def _render(scene: Scene, view: int, field: AbstractField | None) -> Float32[np.ndarray, "rows cols"]:
    field = None if field is None else field_facing(field, turn_of(scene, view))
    scene, view = facing(scene, view)
    camera = scene.views[view].camera
    choice = choose(scene, view, field)
    pattern = jnp.asarray(pattern_image(scene))
    offsets, weights = (jnp.asarray(a, jnp.float32) for a in quadrature(choice.samples))
    # As many rows for the reference as for the flow, whatever its stride, so that both run one program.
    rows = min(max(1, _PIXELS_A_BLOCK // camera.width_px), camera.height_px)
    image = np.zeros((camera.height_px, camera.width_px), np.float32)
    for first in range(0, camera.height_px, rows):
        geometry = pixel_geometry(scene, view, filled(_raster(first, rows, camera.width_px, 1)))
        exposure = Exposure(geometry, offsets[:, None], weights)
        lit = np.zeros(len(geometry.weight), np.float32)
        points = lens_points(choice)
        for point in points:
            motion = exposure.still
            if field is not None:
                motion = jnp.broadcast_to(
                    _motion(scene, view, field, choice, point, first, rows), motion.shape
                )
            lit += np.asarray(_expose(exposure, pattern, motion)) / len(points)
        own = lit[: rows * camera.width_px].reshape(rows, -1)
        image[first : first + rows] = own[: camera.height_px - first]
    return image


def _motion(
    scene: Scene, view: int, field: AbstractField, choice: RenderChoice,
    point: tuple[float, float], first: int, rows: int,
) -> Float[Array, "samples_or_1 pixels 3"]:  # fmt: skip
    """The pattern's motion of a block: from a ray a sample, or from rays every `stride` pixels."""
    width, stride = scene.views[view].camera.width_px, choice.stride
    if not stride:
        pixels = filled(_raster(first, rows, width, 1))
        geometries = [pixel_geometry(scene, view, pixels + o, point) for o in quadrature(choice.samples)[0]]
        return jnp.stack([_traced(g, field, choice) for g in geometries])
    lattice = _raster(first, rows + 2 * stride - 1, width + 2 * stride - 1, stride)
    geometry = pixel_geometry(scene, view, filled(lattice), point)
    lattice_cols = len(np.arange(0, width + 2 * stride - 1, stride))
    motion = _traced(geometry, field, choice)
    layout = (len(lattice), lattice_cols, stride, rows, width)
    return _spread_motion(motion, geometry.weight > 0, layout)[None]


def _raster(first_row: int, rows: int, cols: int, stride: int) -> Float[np.ndarray, "pixels 2"]:
    row, column = np.mgrid[first_row : first_row + rows : stride, 0:cols:stride]
    return np.stack([column.ravel(), row.ravel()], axis=1).astype(float)


_traced = eqx.filter_jit(pattern_motion)


@eqx.filter_jit
def _expose(exposure: Exposure, pattern: Array, motion: Array) -> Float[Array, " pixels"]:
    return exposure.luminance(pattern, motion)


@eqx.filter_jit
def _spread_motion(
    motion: Float[Array, "lattice 3"], lit: Array, layout: tuple[int, int, int, int, int]
) -> Float[Array, "pixels 3"]:
    """Bilinear between the rays of the lattice; rays that see no pattern are left out of the mean."""
    count, cols, stride, rows, width = layout
    known = lit.astype(motion.dtype)[:, None]
    values = jnp.concatenate([motion * known, known], axis=1)[:count].reshape(-1, cols, 4)
    full = _spread(_spread(values, stride).swapaxes(0, 1), stride).swapaxes(0, 1)[:rows, :width]
    own = (full[..., :3] / jnp.maximum(full[..., 3:], 1e-6)).reshape(-1, 3)
    return jnp.pad(own, ((0, shared_count(rows * width) - rows * width), (0, 0)))


def _spread(values: Float[Array, "n m c"], stride: int) -> Float[Array, "fine m c"]:
    """Linear interpolation between neighbours along the first axis, `stride` values each."""
    share = (jnp.arange(stride).astype(values.dtype) / stride)[None, :, None, None]
    low, high = values[:-1, None], values[1:, None]
    return (low + share * (high - low)).reshape(-1, *values.shape[1:])
