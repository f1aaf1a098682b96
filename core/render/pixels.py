"""The luminance of chosen pixels as a differentiable function of the field (paper, eq. 2).

    I_j = sum_s w_s L(c(s) + shift(s)) cos / r

Sample positions on the undisturbed pattern belong to the scene alone: reference, flow and prediction
share them, whichever rays carry the shift.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.fields import AbstractField
from core.render.irradiance import irradiance_factor
from core.render.light import pattern_image, sample_pattern
from core.render.pixel_filter import lens_disc, monte_carlo, quadrature
from core.render.pixel_geometry import PixelGeometry, pixel_geometry
from core.render.render_choice import RenderChoice, choose
from core.render.shift import pattern_offset_px, wall_offset_m
from core.scene import Scene
from core.view_frame import Turn, facing, field_facing, turn_of


class Exposure(eqx.Module):
    """Pixels and their sample points: `_` is the number of pixels, or 1 for the same points in each."""

    geometry: PixelGeometry
    offsets_px: Float[Array, "samples _ 2"]
    weights: Float[Array, " samples"]

    def luminance(
        self, pattern: Float[Array, "rows cols"], motion: Float[Array, "samples pixels 3"]
    ) -> Float[Array, " pixels"]:
        """Filtered pattern; `motion` is the shift (column, row) [px] and the light's gain minus 1."""

        # One sample's program for all of them: it compiles in a fraction of the time.
        def add(total: Array, sample: tuple[Array, Array, Array]) -> tuple[Array, None]:
            offset, weight, moved = sample
            step_px = jnp.sum(self.geometry.pattern_from_pixel * offset[:, None, :], axis=-1)
            place_px = self.geometry.fraction_px + step_px + moved[:, :2]
            light = sample_pattern(pattern, self.geometry.cell, place_px)
            return total + weight * (1.0 + moved[:, 2]) * light, None

        none = jnp.zeros_like(self.geometry.weight)
        total, _ = jax.lax.scan(add, none, (self.offsets_px, self.weights, motion))
        return total * self.geometry.weight

    @property
    def still(self) -> Float[Array, "samples pixels 3"]:
        """The motion of air at rest."""
        return jnp.zeros((len(self.weights), *self.geometry.weight.shape, 3), jnp.float32)


class PixelRenderer(eqx.Module):
    """Renders its pixels; build it with `pixel_renderer` and pass it into jitted functions.

    `rays`: for each point of the lens, one geometry for all samples of a pixel, or one a sample.
    """

    pattern: Float[Array, "rows cols"]
    exposure: Exposure
    rays: tuple[tuple[PixelGeometry, ...], ...]
    choice: RenderChoice
    turn: Turn = eqx.field(static=True)

    def reference(self) -> Float[Array, " pixels"]:
        """Luminance through air at rest."""
        return self.exposure.luminance(self.pattern, self.exposure.still)

    def flow(self, field: AbstractField) -> Float[Array, " pixels"]:
        """Luminance through a flow; differentiable in the field."""
        field = field_facing(field, self.turn)
        total = jnp.zeros_like(self.exposure.geometry.weight)
        for bundle in self.rays:
            motions = [pattern_motion(geometry, field, self.choice) for geometry in bundle]
            motion = jnp.broadcast_to(jnp.stack(motions), self.exposure.still.shape)
            total = total + self.exposure.luminance(self.pattern, motion) / len(self.rays)
        return total


def pattern_motion(
    geometry: PixelGeometry, field: AbstractField, choice: RenderChoice
) -> Float[Array, "rays 3"]:
    """How far the pattern coordinate moves (column, row) [px], and the light's gain minus 1."""
    offset_m = wall_offset_m(geometry, field, choice.tracer, choice.projector_order)
    gain = jnp.zeros_like(geometry.weight)
    if choice.irradiance:
        gain = irradiance_factor(geometry, field, choice.tracer, offset_m) - 1.0
    return jnp.concatenate([pattern_offset_px(geometry, offset_m), gain[:, None]], axis=-1)


def pixel_renderer(
    scene: Scene,
    view: int,
    pixels: Float[np.ndarray, "pixels 2"],
    field: AbstractField | None = None,
    monte_carlo_seed: int | None = None,
) -> PixelRenderer:
    """A renderer of pixels (column, row); `field` is one like those to come, for the `auto` choices.

    The pixel integral is a Gauss quadrature of the triangle filter, or, with a seed, Monte Carlo with common
    random numbers. Where a pixel covers a good part of a cell of the field, every sample traces its own ray.
    """
    turn = turn_of(scene, view)
    scene, view = facing(scene, view)
    choice = choose(scene, view, None if field is None else field_facing(field, turn))
    offsets, weights = _samples(scene, view, pixels, choice.samples, monte_carlo_seed)
    exposure = Exposure(pixel_geometry(scene, view, pixels), jnp.asarray(offsets), jnp.asarray(weights))
    own = [np.zeros((1, 2))] if choice.stride else list(offsets)
    rays = tuple(
        tuple(pixel_geometry(scene, view, pixels + offset, point) for offset in own)
        for point in lens_points(choice)
    )
    return PixelRenderer(jnp.asarray(pattern_image(scene)), exposure, rays, choice, turn)


def lens_points(choice: RenderChoice) -> list[tuple[float, float]]:
    """Places on the aperture that rays leave from; the middle alone for a pinhole."""
    if choice.aperture_m is None:
        return [(0.0, 0.0)]
    return [(float(x), float(y)) for x, y in lens_disc(choice.aperture_m)]


def _samples(
    scene: Scene, view: int, pixels: np.ndarray, samples: int, seed: int | None
) -> tuple[Float[np.ndarray, "samples _ 2"], Float[np.ndarray, " samples"]]:
    if seed is None:
        offsets, weights = quadrature(samples)
        return offsets[:, None].astype(np.float32), weights.astype(np.float32)
    numbers = np.rint(pixels[:, 1] * scene.views[view].camera.width_px + pixels[:, 0]).astype(np.int32)
    offsets = np.asarray(monte_carlo(seed, jnp.asarray(numbers), samples), np.float32)
    return offsets, np.full(samples, 1 / samples, np.float32)
