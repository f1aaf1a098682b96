"""The coupled ray equation by a symplectic, reversible integrator, and its memory-free adjoint."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from core.fields import AbstractField, Components, apart
from core.rays.bundle import Rays, walk
from core.rays.sum_along import perturbed_part
from core.rays.tracer import AbstractRayTracer, Bend, land

State = tuple[Components, Components]


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
        ends = _leapfrog((rays, apart(start), field), self.steps, scale)
        deviation_m, turn = (jnp.stack(e, axis=-1) for e in ends)
        return land(rays, turn, deviation_m, rays.direction + turn)


def _force(inputs: PyTree, offset_m: Components, place: Array, scale: float) -> Components:
    """(1 + m) grad m a fraction `place` of the way along each ray, moved off it by `offset_m`."""
    rays, field = inputs
    x, y, z = (p + o for p, o in zip(walk(rays, place * rays.length_m), offset_m, strict=True))
    excess, gradient = field.at((x, y, z))
    strength = scale * (1.0 + scale * excess)
    return gradient[0] * strength, gradient[1] * strength, gradient[2] * strength


def _plus(a: Components, factor: Array | float, b: Components) -> Components:
    """a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def _dot(a: Components, b: Components) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@eqx.filter_custom_vjp
def _leapfrog(inputs: PyTree, steps: int, scale: float) -> State:
    rays, start, field = inputs
    step_m = rays.length_m / steps

    def advance(state: State, index: Array) -> tuple[State, None]:
        deviation_m, turn = state
        middle_m = _plus(deviation_m, 0.5 * step_m, turn)
        turn = _plus(turn, step_m, _force((rays, field), middle_m, (index + 0.5) / steps, scale))
        return (_plus(middle_m, 0.5 * step_m, turn), turn), None

    places = jnp.arange(steps).astype(step_m.dtype)
    rest = jax.tree.map(jnp.zeros_like, start)
    return jax.lax.scan(advance, (rest, start), places)[0]


@_leapfrog.def_fwd
def _leapfrog_forward(perturbed: PyTree, inputs: PyTree, steps: int, scale: float) -> tuple[State, State]:
    end = _leapfrog(inputs, steps, scale)
    return end, end


@_leapfrog.def_bwd
def _leapfrog_backward(
    end: State, cotangent: PyTree, perturbed: PyTree, inputs: PyTree, steps: int, scale: float
) -> PyTree:
    """Retrace the steps from the end; a bar marks the loss's gradient in a quantity."""
    rays, _, field = inputs
    moving, still = perturbed_part((perturbed[0], perturbed[2]), (rays, field))
    step_m = rays.length_m / steps
    # An output that the loss does not use has no cotangent.
    bars = eqx.combine(cotangent, jax.tree.map(jnp.zeros_like, end))

    def retreat(carry: PyTree, index: Array) -> tuple[PyTree, None]:
        (deviation_m, turn), (deviation_bar, turn_bar), step_bar, moving_bar = carry
        middle_m = _plus(deviation_m, -0.5 * step_m, turn)
        force, pull_back = jax.vjp(
            lambda m, x: _force(eqx.combine(m, still), x, (index + 0.5) / steps, scale), moving, middle_m
        )
        before = _plus(turn, -step_m, force)
        turn_bar = _plus(turn_bar, 0.5 * step_m, deviation_bar)
        own_bar, place_bar = pull_back(tuple(step_m * t for t in turn_bar))
        middle_bar = _plus(deviation_bar, 1.0, place_bar)
        step_bar = step_bar + 0.5 * _dot(turn, deviation_bar) + _dot(force, turn_bar)
        step_bar = step_bar + 0.5 * _dot(before, middle_bar)
        turn_bar = _plus(turn_bar, 0.5 * step_m, middle_bar)
        state = (_plus(middle_m, -0.5 * step_m, before), before)
        return (state, (middle_bar, turn_bar), step_bar, jax.tree.map(jnp.add, moving_bar, own_bar)), None

    carry = (end, bars, jnp.zeros_like(step_m), jax.tree.map(jnp.zeros_like, moving))
    places = jnp.arange(steps - 1, -1, -1).astype(step_m.dtype)
    _, (_, start_bar), step_bar, (rays_bar, field_bar) = jax.lax.scan(retreat, carry, places)[0]
    if rays_bar.length_m is not None:
        rays_bar = eqx.tree_at(lambda r: r.length_m, rays_bar, rays_bar.length_m + step_bar / steps)
    return rays_bar, start_bar, field_bar
