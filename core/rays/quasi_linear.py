"""The paper's tracer: the velocity from the straight path, the landing point from that velocity."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from core.fields import AbstractField, Components
from core.rays.bundle import Rays, walk
from core.rays.sum_along import sum_along
from core.rays.tracer import AbstractRayTracer, Bend, land


class QuasiLinearTracer(AbstractRayTracer):
    """Query the index along the straight ray, integrate velocity and position from it (paper, II-B).

        u(s) = m(x0) d + int_0^s (1 + m) grad m        landing point: x0 + s d + int u, cut with the wall

    Cost and memory: as `StraightTracer`, with the value besides the gradient. Error: second order in m, of
    the path alone: the cut with the wall is exact. Not for rays that bend by more than a cell.
    """

    steps: int = eqx.field(static=True)
    ambient_refractivity: float = 0.0

    def bend(self, rays: Rays, field: AbstractField) -> Bend:
        """Trace every ray to the back wall."""
        scale = 1.0 / (1.0 + self.ambient_refractivity)
        sums = sum_along(_pull(self.steps, scale), (rays, field), self.steps)
        turn, deviation_m = (jnp.stack(s, axis=-1) for s in sums)
        start = (field.excess(rays.entry_m) * scale)[:, None] * rays.direction
        turn = turn + start
        return land(rays, turn, deviation_m + start * rays.length_m[:, None], rays.direction + turn)


def _pull(steps: int, scale: float):
    def term(inputs: PyTree, index: Array) -> tuple[Components, Components]:
        rays, field = inputs
        step_m = rays.length_m / steps
        along_m = step_m * (index + 0.5)
        excess, gradient = field.at(walk(rays, along_m))
        lever_m = rays.length_m - along_m
        x, y, z = (g * (scale * step_m * (1.0 + scale * excess)) for g in gradient)
        return (x, y, z), (x * lever_m, y * lever_m, z * lever_m)

    return term
