"""The coupled ray equation by a symplectic, reversible integrator, and its memory-free adjoint."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from core.fields import AbstractField
from core.rays.bundle import Rays
from core.rays.tracer import AbstractRayTracer, Bend, land

State = tuple[Float[Array, "rays 3"], Float[Array, "rays 3"]]


class NonlinearTracer(AbstractRayTracer):
    """Leapfrog (drift, kick, drift) on the deviation delta and its velocity u (paper, eq. 1).

        delta' = u,    u' = (1 + m) grad m  at  x0 + s d + delta,    u(0) = m(x0) d

    Second order in 1/steps, symplectic, and exactly reversible: the adjoint runs the same steps backwards
    and stores the end state only, so the memory of a gradient does not grow with `steps`. Cost: one
    gradient of the field a step; its gradient about four times that. Valid for any bending that
    `steps` resolves; a ray that no longer advances ends as `turned_back`.
    """

    steps: int = eqx.field(static=True)
    ambient_refractivity: float = 0.0

    def bend(self, rays: Rays, field: AbstractField) -> Bend:
        """Trace every ray to the back wall."""
        scale = 1.0 / (1.0 + self.ambient_refractivity)
        start = (field.excess(rays.entry_m) * scale)[:, None] * rays.direction
        deviation_m, turn = _leapfrog((rays, start, field), self.steps, scale)
        return land(rays, turn, deviation_m, rays.direction + turn)


def _force(inputs: PyTree, offset_m: Float[Array, "rays 3"], place: Array, scale: float) -> Array:
    """(1 + m) grad m a fraction `place` of the way along each ray, moved off it by `offset_m`."""
    rays, field = inputs
    points_m = rays.entry_m + (place * rays.length_m)[:, None] * rays.direction + offset_m
    excess, gradient = field.excess_and_gradient(points_m)
    return gradient * (scale * (1.0 + scale * excess))[:, None]


@eqx.filter_custom_vjp
def _leapfrog(inputs: PyTree, steps: int, scale: float) -> State:
    rays, start, field = inputs
    step_m = (rays.length_m / steps)[:, None]

    def advance(state: State, index: Array) -> tuple[State, None]:
        deviation_m, turn = state
        middle_m = deviation_m + 0.5 * step_m * turn
        turn = turn + step_m * _force((rays, field), middle_m, (index + 0.5) / steps, scale)
        return (middle_m + 0.5 * step_m * turn, turn), None

    places = jnp.arange(steps).astype(start.dtype)
    return jax.lax.scan(advance, (jnp.zeros_like(start), start), places)[0]


@_leapfrog.def_fwd
def _leapfrog_forward(perturbed: PyTree, inputs: PyTree, steps: int, scale: float) -> tuple[State, State]:
    end = _leapfrog(inputs, steps, scale)
    return end, end


@_leapfrog.def_bwd
def _leapfrog_backward(
    end: State, cotangent: PyTree, perturbed: PyTree, inputs: PyTree, steps: int, scale: float
) -> PyTree:
    """Retrace the steps from the end; a bar marks the loss's gradient in a quantity."""
    rays, start, field = inputs
    moving, still = eqx.partition((rays, field), eqx.is_inexact_array)
    step_m = (rays.length_m / steps)[:, None]
    # An output that the loss does not use has no cotangent.
    bars = eqx.combine(cotangent, jax.tree.map(jnp.zeros_like, end))

    def retreat(carry: PyTree, index: Array) -> tuple[PyTree, None]:
        (deviation_m, turn), (deviation_bar, turn_bar), step_bar, moving_bar = carry
        middle_m = deviation_m - 0.5 * step_m * turn
        force, pull_back = jax.vjp(
            lambda m, x: _force(eqx.combine(m, still), x, (index + 0.5) / steps, scale), moving, middle_m
        )
        before = turn - step_m * force
        turn_bar = turn_bar + 0.5 * step_m * deviation_bar
        own_bar, middle_bar = pull_back(step_m * turn_bar)
        middle_bar = middle_bar + deviation_bar
        step_bar = step_bar + jnp.sum(
            0.5 * turn * deviation_bar + force * turn_bar + 0.5 * before * middle_bar, axis=-1
        )
        turn_bar = turn_bar + 0.5 * step_m * middle_bar
        state = (middle_m - 0.5 * step_m * before, before)
        return (state, (middle_bar, turn_bar), step_bar, jax.tree.map(jnp.add, moving_bar, own_bar)), None

    carry = (end, bars, jnp.zeros_like(rays.length_m), jax.tree.map(jnp.zeros_like, moving))
    places = jnp.arange(steps - 1, -1, -1).astype(start.dtype)
    _, (_, start_bar), step_bar, (rays_bar, field_bar) = jax.lax.scan(retreat, carry, places)[0]
    rays_bar = eqx.tree_at(lambda r: r.length_m, rays_bar, rays_bar.length_m + step_bar / steps)
    return rays_bar, start_bar, field_bar
