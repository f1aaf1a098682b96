"""The paper's image loss: rays traced through the representation itself, camera's and projector's.

Every sample of a mini-batch asks the representation for the index and its gradient along its whole path:
64 evaluations a ray. `core.losses.shifts` reads the same shifts from one evaluation on a vertex grid, which
every ray of the picture shares; that is what a reconstruction should use. This is how it was published.
"""

import dataclasses
from typing import cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from core.air import Air
from core.fields import AbstractField, Components
from core.geometry import Vector3
from core.losses.boussinesq import Scales
from core.losses.physics import Rows
from core.losses.representation import Fields, Unknowns
from core.problem import ImagePair, ShiftMeasurement
from core.rays import QuasiLinearTracer
from core.render.light import pattern_image, sample_pattern
from core.render.pixel_geometry import PixelGeometry, pixel_geometry
from core.render.shift import pattern_offset_px, wall_offset_m
from core.scene import Scene
from core.setting import SettingError


class RepresentedAir(AbstractField):
    """The excess refractivity of a representation's temperature, with its exact gradient."""

    fields: Fields
    scales: Scales = eqx.field(static=True)
    air: Air = eqx.field(static=True)
    origin_m: Vector3 = eqx.field(static=True)

    def at(self, place_m: Components) -> tuple[Float[Array, " points"], Components]:
        """Value and gradient [1/m], by one forward pass that carries three derivatives along."""
        length_m = self.scales.length_m
        points = jnp.stack(
            [(p - low) / length_m for p, low in zip(place_m, self.origin_m, strict=True)], axis=-1
        )

        def along(direction: Float[Array, "3"]) -> tuple[Array, Array]:
            tangent = jnp.broadcast_to(direction, points.shape)
            return jax.jvp(self._excess, (points,), (tangent,))

        value, slopes = jax.vmap(along, out_axes=(None, 0))(jnp.eye(3, dtype=points.dtype))
        return value, (slopes[0] / length_m, slopes[1] / length_m, slopes[2] / length_m)

    def _excess(self, points_nd: Float[Array, "points 3"]) -> Float[Array, " points"]:
        excess_k = self.scales.excess_k * self.fields.at(points_nd).temperature
        # An optimiser may try temperatures near 0 K: refractivity must stay finite.
        return self.air.excess_refractivity(jnp.maximum(excess_k, -0.8 * self.air.ambient_temperature_k))


class RenderedRows(eqx.Module):
    """A view's picture, rendered at the samples of the measured one: (I_model − I_flow) / σ.

    Only a simulation knows those samples, and its camera stands still: there is no drift.
    """

    geometry: PixelGeometry
    pattern: Float[Array, "rows cols"]
    flow: Float[Array, " pixels"]
    std: float = eqx.field(static=True)
    samples: int = eqx.field(static=True)

    @property
    def count(self) -> int:
        """Pixels."""
        return self.flow.shape[0]

    def errors(
        self, chosen: Array, air: RepresentedAir, tracer: QuasiLinearTracer, drift: Float[Array, "6"] | None
    ) -> Float[Array, " some"]:
        """Of some pixels, over the noise."""
        geometry = _chosen(self.geometry, chosen, self.samples)
        shift_px = pattern_offset_px(geometry, wall_offset_m(geometry, air, tracer))
        light = sample_pattern(self.pattern, geometry.cell, geometry.fraction_px + shift_px) * geometry.weight
        return (light.reshape(-1, self.samples).mean(1) - self.flow[chosen]) / self.std


class TracedWindows(eqx.Module):
    """A view's windows: the shift of the ray in their middle, against what was measured, over its noise."""

    geometry: PixelGeometry
    seen_from_wall: Float[Array, "windows 2 3"]
    root: Float[Array, "windows 2 2"]
    target: Float[Array, "windows 2"]
    motions: Float[Array, "windows 2 6"]

    @property
    def count(self) -> int:
        """Windows."""
        return self.target.shape[0]

    def errors(
        self, chosen: Array, air: RepresentedAir, tracer: QuasiLinearTracer, drift: Float[Array, "6"] | None
    ) -> Float[Array, "some 2"]:
        """Of some windows, over the noise."""
        offset_m = wall_offset_m(_chosen(self.geometry, chosen, 1), air, tracer)
        shift_px = jnp.einsum("wij,wj->wi", self.seen_from_wall[chosen], offset_m)
        if drift is not None:
            shift_px = shift_px + self.motions[chosen] @ drift
        return jnp.einsum("wki,wi->wk", self.root[chosen], shift_px) - self.target[chosen]


class TracedLoss(eqx.Module):
    """λ1 times the mean over pixels and views of the squared error over the noise."""

    views: tuple[RenderedRows | TracedWindows, ...]
    scales: Scales = eqx.field(static=True)
    air: Air = eqx.field(static=True)
    origin_m: Vector3 = eqx.field(static=True)
    steps: int = eqx.field(static=True, default=64)
    weight: float = eqx.field(static=True, default=1.0)
    pixels: int = eqx.field(static=True, default=5000)
    name: str = eqx.field(static=True, default="bos")

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """All rows, or a random choice."""
        air = RepresentedAir(fields, self.scales, self.air, self.origin_m)
        tracer = QuasiLinearTracer(self.steps, self.air.ambient_refractivity)
        found = []
        for place, view in enumerate(self.views):
            chosen = jnp.arange(view.count)
            if key is not None:
                own = jax.random.fold_in(key, place)
                chosen = jax.random.randint(own, (min(self.pixels, view.count),), 0, view.count)
            drift = None if unknowns.drift is None else unknowns.drift[place]
            errors = view.errors(chosen, air, tracer, drift)
            found.append((self.weight / (errors.size * len(self.views))) ** 0.5 * errors)
        return tuple(found)

    def with_batch(self, pixels: int) -> "TracedLoss":
        """The same on mini-batches of `pixels` pixels a view."""
        return dataclasses.replace(self, pixels=pixels)


def rendered_view(scene: Scene, view: int, pair: ImagePair) -> RenderedRows:
    """All pixels of a picture whose sample positions are known. Raises SettingError where they are not."""
    if pair.sample_offsets_px is None:
        raise SettingError(
            "The rendered data term needs the sample positions of the images, which only a simulation has. "
            "Take data_term = 'warped' or 'displacement' for measured images."
        )
    rows, cols, samples, _ = pair.sample_offsets_px.shape
    row, column = np.mgrid[0:rows, 0:cols]
    centres = np.stack([column, row], axis=-1)[:, :, None].astype(float)
    return RenderedRows(
        pixel_geometry(scene, view, (centres + pair.sample_offsets_px).reshape(-1, 2)),
        jnp.asarray(pattern_image(scene)),
        jnp.asarray(pair.flow_image.ravel(), jnp.float32),
        float(pair.difference_variance) ** 0.5,
        samples,
    )


def traced_windows(
    scene: Scene,
    view: int,
    shift: ShiftMeasurement,
    model_std_px: float,
    motions: Float[np.ndarray, "windows 2 6"],
) -> TracedWindows:
    """Windows with the inverse of noise plus model covariance as weight; `motions` as in `displacement_rows`."""
    geometry = pixel_geometry(scene, view, shift.centres_px)
    pattern_from_pixel = np.asarray(geometry.pattern_from_pixel, np.float64)
    unlit = np.abs(pattern_from_pixel).sum((1, 2)) == 0
    pattern_from_pixel[unlit] = np.eye(2)
    seen = -np.linalg.solve(pattern_from_pixel, np.asarray(geometry.pattern_from_wall, np.float64))
    covariance = np.linalg.inv(shift.information_per_px2) + model_std_px**2 * np.eye(2)
    root = np.linalg.cholesky(np.linalg.inv(covariance)).transpose(0, 2, 1)
    target = np.einsum("wki,wi->wk", root, shift.displacement_px)
    return TracedWindows(geometry, *(jnp.asarray(a, jnp.float32) for a in (seen, root, target, motions)))


def _chosen(geometry: PixelGeometry, pixels: Array, samples: int) -> PixelGeometry:
    rows = (pixels[:, None] * samples + jnp.arange(samples)[None]).reshape(-1)
    return cast(PixelGeometry, jax.tree.map(lambda a: a[rows], geometry))
