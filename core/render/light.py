"""Where a point of the back wall looks in the pattern: a print on the wall, or a projector's panel."""

from abc import abstractmethod
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

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
    pixel_m: float = eqx.field(static=True)

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
        return TextureMap(jnp.asarray(corner), scene.light.pixel_m)
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
    """The scene's pattern at its own resolution, 0 to 1; the last two are kept."""
    return _made(scene.light.pattern, *pattern_size(scene))


@lru_cache(maxsize=2)
def _made(pattern: Pattern, rows: int, cols: int) -> Float32[np.ndarray, "rows cols"]:
    return make_pattern(pattern, rows, cols)


def sample_pattern(
    pattern: Float[Array, "rows cols"], cell: Array, offset_px: Float[Array, "rays 2"]
) -> Float[Array, " rays"]:
    """Bilinear luminance at `cell` + `offset_px` (column, row); 0 outside the pattern.

    The whole-pixel part travels as integers: a float32 coordinate at 4096 has a step of 5e-4 px, a tenth
    of the shifts that are to be seen.
    """
    rows, cols = pattern.shape
    whole = jnp.floor(offset_px)
    fraction = offset_px - whole
    col, row = jnp.moveaxis(cell + whole.astype(jnp.int32), -1, 0)
    inside = (col >= -1) & (col < cols) & (row >= -1) & (row < rows)
    flat = pattern.reshape(-1)
    c0, c1 = jnp.clip(col, 0, cols - 1), jnp.clip(col + 1, 0, cols - 1)
    r0, r1 = jnp.clip(row, 0, rows - 1) * cols, jnp.clip(row + 1, 0, rows - 1) * cols
    take = lambda index: flat.at[index].get(mode="promise_in_bounds")  # noqa: E731
    upper = take(r0 + c0) + fraction[:, 0] * (take(r0 + c1) - take(r0 + c0))
    lower = take(r1 + c0) + fraction[:, 0] * (take(r1 + c1) - take(r1 + c0))
    return jnp.where(inside, upper + fraction[:, 1] * (lower - upper), 0.0)


def coordinate_jacobian(light: AbstractPatternMap, wall_point_m: Float[Array, "3"]) -> Float[Array, "2 3"]:
    """d pattern coordinate / d wall point [px/m]."""
    return jax.jacfwd(light.coordinate_px)(wall_point_m)
