"""The deflection integral along the straight ray."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from core.fields import AbstractField, Components
from core.rays.bundle import Rays, walk
from core.rays.sum_along import sum_along
from core.rays.tracer import AbstractRayTracer, Bend, land


class StraightTracer(AbstractRayTracer):
    """First order in the field: integrate the index gradient along the undisturbed ray.

        turn = int grad m ds        wall shift = int (L - s) grad m ds, slid along the ray onto the wall

    A linear map of the field. Cost: `steps` gradients a ray; memory of a gradient: one step. Midpoint
    rule: O(1/steps^2), better for smooth fields that fade at both ends. Error: second order in m;
    README has the figures. Not for rays that bend by more than a cell of the field.
    """

    steps: int = eqx.field(static=True)
    ambient_refractivity: float = 0.0

    def bend(self, rays: Rays, field: AbstractField) -> Bend:
        """Trace every ray to the back wall."""
        scale = 1.0 / (1.0 + self.ambient_refractivity)
        sums = sum_along(_pull(self.steps), (rays, field), self.steps)
        turn, deviation_m = (jnp.stack(s, axis=-1) * scale for s in sums)
        return land(rays, turn, deviation_m, rays.direction)


def _pull(steps: int):
    def term(inputs: PyTree, index: Array) -> tuple[Components, Components]:
        rays, field = inputs
        step_m = rays.length_m / steps
        along_m = step_m * (index + 0.5)
        _, gradient = field.at(walk(rays, along_m))
        lever_m = rays.length_m - along_m
        x, y, z = (g * step_m for g in gradient)
        return (x, y, z), (x * lever_m, y * lever_m, z * lever_m)

    return term
