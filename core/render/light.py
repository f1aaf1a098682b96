"""Where a point of the back wall looks in the pattern: a print on the wall, or a projector's panel."""

from abc import abstractmethod
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32
from scipy.ndimage import spline_filter

from core.geometry import Box
from core.pattern import make_pattern
from core.rays.optics import Pinhole, pinhole
from core.scene import FixedTexture, Pattern, Scene


class AbstractPatternMap(eqx.Module):
    """Wall point -> pattern coordinate (column, row), (0, 0) the centre of the first pattern pixel."""

    @abstractmethod
    def coordinate_px(self, wall_point_m: Float[Array, "3"]) -> Float[Array, "2"]:
        """Pattern coordinate of a wall point."""

    @abstractmethod
    def depth_slope(self, wall_point_m: Float[Array, "3"]) -> Float[Array, "3"]:
        """Relative change of depth a metre of wall shift [1/m]: the denominator of a homography."""


class TextureMap(AbstractPatternMap):
    """A print or screen that fills the wall, pattern row 0 at its top, column 0 at small x."""

    left_top_m: Float[Array, "2"]
    pixel_m: Float[Array, ""]

    def coordinate_px(self, wall_point_m: Float[Array, "3"]) -> Float[Array, "2"]:
        """Pattern coordinate of a wall point."""
        across = jnp.stack([wall_point_m[0] - self.left_top_m[0], self.left_top_m[1] - wall_point_m[2]])
        return across / self.pixel_m - 0.5

    def depth_slope(self, wall_point_m: Float[Array, "3"]) -> Float[Array, "3"]:
        """Zero: a print keeps its scale."""
        return jnp.zeros_like(wall_point_m)


class ProjectorMap(AbstractPatternMap):
    """A projector's panel, as an inverse camera with distortion."""

    optics: Pinhole

    def coordinate_px(self, wall_point_m: Float[Array, "3"]) -> Float[Array, "2"]:
        """Panel coordinate whose straight ray lands on a wall point."""
        return self.optics.project(wall_point_m)

    def depth_slope(self, wall_point_m: Float[Array, "3"]) -> Float[Array, "3"]:
        """Optical axis over depth."""
        return self.optics.rotation[2] / self.optics.depth_m(wall_point_m)


def pattern_map(scene: Scene) -> AbstractPatternMap:
    """The map of the scene's light, in JAX's widest enabled float."""
    if isinstance(scene.light, FixedTexture):
        corner = np.array([scene.room.lower_m[0], scene.room.upper_m[2]])
        return TextureMap(jnp.asarray(corner), jnp.asarray(np.array(scene.light.pixel_m)))
    return ProjectorMap(pinhole(scene.light.projector))


def pattern_size(scene: Scene) -> tuple[int, int]:
    """Rows and columns of the pattern: the projector's panel, or the wall in pattern pixels."""
    if isinstance(scene.light, FixedTexture):
        return texture_size(scene.room, scene.light.pixel_m)
    return scene.light.projector.height_px, scene.light.projector.width_px


def texture_size(room: Box, pixel_m: float) -> tuple[int, int]:
    """Rows and columns of a print of `pixel_m` that covers the back wall."""
    return int(np.ceil(room.size_m[2] / pixel_m)), int(np.ceil(room.size_m[0] / pixel_m))


def pattern_image(scene: Scene) -> Float32[np.ndarray, "rows cols"]:
    """Cubic B-spline coefficients of the scene's pattern, for `sample_pattern`; the last two are kept."""
    return _made(scene.light.pattern, *pattern_size(scene))


@lru_cache(maxsize=2)
def _made(pattern: Pattern, rows: int, cols: int) -> Float32[np.ndarray, "rows cols"]:
    luminance = make_pattern(pattern, rows, cols)
    return spline_filter(luminance, order=3, output=np.float64, mode="mirror").astype(np.float32)


def sample_pattern(
    coefficients: Float[Array, "rows cols"], cell: Array, offset_px: Float[Array, "rays 2"]
) -> Float[Array, " rays"]:
    """Luminance at `cell` + `offset_px` (column, row) by cubic B-spline; 0 outside the pattern.

    The whole-pixel part travels as integers: a float32 coordinate at 4096 has a step of 5e-4 px, a tenth
    of the shifts that are to be seen. Bilinear sampling will not do: its slope is a secant that jumps at
    the pattern's pixels, and a camera whose pixels are commensurate with them then sees shifts that are
    wrong by 5 to 15 %; the cubic spline's are right to 0.7 %.
    """
    rows, cols = coefficients.shape
    whole = jnp.floor(offset_px)
    fraction = offset_px - whole
    col, row = jnp.moveaxis(cell + whole.astype(jnp.int32), -1, 0)
    inside = (col >= -1) & (col < cols) & (row >= -1) & (row < rows)
    flat = coefficients.reshape(-1)
    columns = [jnp.clip(col + i, 0, cols - 1) for i in range(-1, 3)]
    across, down = _cubic_weights(fraction[:, 0]), _cubic_weights(fraction[:, 1])
    total = jnp.zeros_like(fraction[:, 0])
    for i, weight in zip(range(-1, 3), down, strict=True):
        start = jnp.clip(row + i, 0, rows - 1) * cols
        line = [flat.at[start + c].get(mode="promise_in_bounds") for c in columns]
        total = total + weight * sum(w * value for w, value in zip(across, line, strict=True))
    return jnp.where(inside, total, 0.0)


def _cubic_weights(t: Float[Array, " rays"]) -> tuple[Float[Array, " rays"], ...]:
    """Values of the four cubic B-splines over a cell at 0 <= t < 1."""
    s = 1.0 - t
    return (
        s * s * s / 6.0,
        2.0 / 3.0 - 0.5 * t * t * (2.0 - t),
        2.0 / 3.0 - 0.5 * s * s * (2.0 - s),
        t * t * t / 6.0,
    )


def coordinate_jacobian(light: AbstractPatternMap, wall_point_m: Float[Array, "3"]) -> Float[Array, "2 3"]:
    """d pattern coordinate / d wall point [px/m]."""
    return jax.jacfwd(light.coordinate_px)(wall_point_m)
