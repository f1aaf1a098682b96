"""The image loss: the shifts that the model's air causes, against the measured ones.

The flow image is linear in the shift d (physics: shifts are far below a pixel), so all three data terms
are rows  (g · d − b) / σ  at sensor positions:

    rendered      g = −∇I of the model's reference at its own samples     b = I_flow − I_ref,model
    warped        g = −∇I of the measured reference                       b = I_flow − I_ref
    displacement  two rows a window: the square root of its information times d, against d_measured

The model's d comes from the air's temperature on the vertices of the room by straight rays.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from core.air import Air
from core.losses.boussinesq import Scales
from core.losses.physics import Rows
from core.losses.representation import Fields, Spans, Unknowns
from core.problem import ShiftMeasurement
from core.rays.operator import StraightRayOperator


class ShiftRows(eqx.Module):
    """Rows of one view. `samples` consecutive positions are added up to one row (one pixel).

    `motions` are what a unit of each of the camera's motions does at the positions.
    """

    operator: StraightRayOperator
    matrix: Float[Array, "positions k 2"]
    target: Float[Array, "rows k"]
    motions: Float[Array, "positions 2 6"]
    samples: int = eqx.field(static=True, default=1)

    def errors(
        self, excess: Float[Array, "nx ny nz"], drift: Float[Array, "6"] | None
    ) -> Float[Array, "rows k"]:
        """Model minus measurement, over the noise."""
        shift = self.operator.apply(excess)
        if drift is not None:
            shift = shift + self.motions @ drift
        seen = jnp.einsum("pki,pi->pk", self.matrix, shift)
        return seen.reshape(-1, self.samples, seen.shape[1]).sum(1) - self.target

    def chosen(self, rows: Array) -> "ShiftRows":
        """The same for some of the rows."""
        first = rows * self.samples
        positions = (first[:, None] + jnp.arange(self.samples)[None]).reshape(-1)
        return ShiftRows(
            self.operator.chosen(positions),
            self.matrix[positions],
            self.target[rows],
            self.motions[positions],
            self.samples,
        )


class ShiftLoss(eqx.Module):
    """λ1 times the mean over rows and views of the squared error over the noise."""

    views: tuple[ShiftRows, ...]
    spans: Spans = eqx.field(static=True)
    scales: Scales = eqx.field(static=True)
    air: Air = eqx.field(static=True)
    weight: float = eqx.field(static=True, default=1.0)
    pixels: int = eqx.field(static=True, default=5000)
    name: str = eqx.field(static=True, default="bos")

    def rows(self, fields: Fields, unknowns: Unknowns, key: PRNGKeyArray | None) -> Rows:
        """All rows, or a random choice."""
        excess_k = self.scales.excess_k * fields.on_grid(self.spans).temperature
        # An optimiser may try temperatures near 0 K: refractivity must stay finite.
        excess_k = jnp.maximum(excess_k, -0.8 * self.air.ambient_temperature_k)
        excess = self.air.excess_refractivity(excess_k)
        found = []
        for place, view in enumerate(self.views):
            drift = None if unknowns.drift is None else unknowns.drift[place]
            if key is not None:
                count = view.target.shape[0]
                own = jax.random.fold_in(key, place)
                view = view.chosen(jax.random.randint(own, (min(self.pixels, count),), 0, count))
            errors = view.errors(excess, drift)
            found.append((self.weight / (errors.size * len(self.views))) ** 0.5 * errors)
        return tuple(found)

    def with_batch(self, pixels: int) -> "ShiftLoss":
        """The same on mini-batches of `pixels` rows a view."""
        return dataclasses.replace(self, pixels=pixels)


def displacement_rows(
    shift: ShiftMeasurement,
    operator: StraightRayOperator,
    motions: Float[np.ndarray, "windows 2 6"],
    model_std_px: float,
) -> ShiftRows:
    """Rows of windows: W^(1/2) (d − d_measured), W the inverse of noise plus model covariance.

    `motions` are what a unit of each of the camera's motions does. `model_std_px` is what the grid or the ray model
    cannot represent of a shift.
    """
    covariance = np.linalg.inv(shift.information_per_px2) + model_std_px**2 * np.eye(2)
    root = np.linalg.cholesky(np.linalg.inv(covariance)).transpose(0, 2, 1)
    target = np.einsum("wki,wi->wk", root, shift.displacement_px)
    return ShiftRows(
        operator,
        jnp.asarray(root, jnp.float32),
        jnp.asarray(target, jnp.float32),
        jnp.asarray(motions, jnp.float32),
    )
