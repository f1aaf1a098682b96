"""The paper's tracer: the velocity from the straight path, the landing point from that velocity."""

import equinox as eqx
from jaxtyping import Array, Float, PyTree

from core.fields import AbstractField
from core.rays.bundle import Rays
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
        turn, deviation_m = sum_along(_pull(self.steps, scale), (rays, field), self.steps)
        start = (field.excess(rays.entry_m) * scale)[:, None] * rays.direction
        turn = turn + start
        return land(rays, turn, deviation_m + start * rays.length_m[:, None], rays.direction + turn)


def _pull(steps: int, scale: float):
    def term(inputs: PyTree, index: Array) -> tuple[Float[Array, "rays 3"], Float[Array, "rays 3"]]:
        rays, field = inputs
        step_m = rays.length_m / steps
        along_m = step_m * (index + 0.5)
        excess, gradient = field.excess_and_gradient(rays.entry_m + along_m[:, None] * rays.direction)
        turn = gradient * (scale * step_m * (1.0 + scale * excess))[:, None]
        return turn, turn * (rays.length_m - along_m)[:, None]

    return term
