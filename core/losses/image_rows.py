"""Rows of single pixels for the image loss: the warped reference, and the paper's rendered image.

    (I_flow − I_ref + ∇I · d) / σ

with d the model's displacement: the flow image is the reference, moved. Warped takes ∇I from the measured
reference; rendered takes both I_ref and ∇I from the model's pattern at the sample positions that the
simulation used, as two independent samples a pixel are noise a thousand times the signal.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy import ndimage

from core.losses.shifts import ShiftRows
from core.motion import CameraMotion
from core.problem import ImagePair
from core.rays.operator import build
from core.render.light import pattern_image, sample_pattern
from core.render.pixel_geometry import PixelGeometry, pixel_geometry
from core.scene import Scene
from core.setting import SettingError
from core.window_fit import derivative_filter

# Larger pictures are measured in windows, which hold the same information and are faster.
MOST_PIXELS = 300_000


def warped_rows(
    scene: Scene, view: int, pair: ImagePair, shape: tuple[int, int, int], motion: CameraMotion
) -> ShiftRows:
    """One row a pixel, from both measured images. Raises SettingError for a picture that is too large.

    `motion` is a unit of the camera's unknown motion.
    """
    rows, cols = pair.reference_image.shape
    if rows * cols > MOST_PIXELS:
        raise SettingError(
            f"A picture of {cols} x {rows} px is too large for the warped term pixel by pixel (at most "
            f"{MOST_PIXELS} px). Take data_term = 'displacement': its windows hold the same information."
        )
    taps = derivative_filter()
    mean = 0.5 * (pair.reference_image + pair.flow_image)
    gradient = np.stack(
        [ndimage.correlate1d(mean, taps, axis=axis, mode="nearest").ravel() for axis in (1, 0)], axis=1
    )
    difference = (pair.flow_image - pair.reference_image).ravel()
    return _rows(scene, view, shape, pixel_centres(rows, cols), gradient, difference, pair, motion, 1)


def rendered_rows(
    scene: Scene, view: int, pair: ImagePair, shape: tuple[int, int, int], motion: CameraMotion
) -> ShiftRows:
    """One row a pixel, the mean of its samples at the positions that the images were rendered at."""
    if pair.sample_offsets_px is None:
        raise SettingError(
            "The rendered data term needs the sample positions of the images, which only a simulation has. "
            "Take data_term = 'warped' or 'displacement' for measured images."
        )
    rows, cols, samples, _ = pair.sample_offsets_px.shape
    offsets = pair.sample_offsets_px.reshape(-1, samples, 2)
    positions = (pixel_centres(rows, cols)[:, None] + offsets).reshape(-1, 2)
    geometry = pixel_geometry(scene, view, positions)
    luminance, gradient = _model(jnp.asarray(pattern_image(scene)), geometry)
    reference = np.asarray(luminance, np.float64).reshape(-1, samples).mean(1)
    difference = pair.flow_image.ravel() - reference
    slopes = np.asarray(gradient, np.float64) / samples
    return _rows(scene, view, shape, positions, slopes, difference, pair, motion, samples)


@eqx.filter_jit
def _model(
    pattern: Float[Array, "rows cols"], geometry: PixelGeometry
) -> tuple[Float[Array, " positions"], Float[Array, "positions 2"]]:
    """Luminance of every sample, and its slope along the picture's columns and rows."""

    def seen(fraction_px: Float[Array, "positions 2"]) -> Float[Array, " positions"]:
        return sample_pattern(pattern, geometry.cell, fraction_px) * geometry.weight

    slope = jax.grad(lambda f: seen(f).sum())(geometry.fraction_px)
    return seen(geometry.fraction_px), jnp.einsum("pi,pij->pj", slope, geometry.pattern_from_pixel)


def _rows(
    scene: Scene,
    view: int,
    shape: tuple[int, int, int],
    positions: Float[np.ndarray, "positions 2"],
    gradient: Float[np.ndarray, "positions 2"],
    difference: Float[np.ndarray, " rows"],
    pair: ImagePair,
    motion: CameraMotion,
    samples: int,
) -> ShiftRows:
    std = pair.difference_variance**0.5
    return ShiftRows(
        build(scene, view, positions, shape),
        jnp.asarray(-gradient[:, None, :] / std, jnp.float32),
        jnp.asarray(difference[:, None] / std, jnp.float32),
        jnp.asarray(motion.at(positions), jnp.float32),
        samples,
    )


def pixel_centres(rows: int, cols: int) -> Float[np.ndarray, "pixels 2"]:
    """Sensor positions (column, row) in the order of the rows."""
    row, column = np.mgrid[0:rows, 0:cols]
    return np.stack([column.ravel(), row.ravel()], axis=1).astype(float)
