"""Gradients against central differences in float64, over one table of fields and tracers."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

from core.fields import FunctionField, GridField, through_vertices
from core.rays import NonlinearTracer, QuasiLinearTracer, StraightTracer
from tests.core.rays.scenes import N0, ROOM, rays_from, wall_points

# Strong fields, so that every term of the adjoint weighs: 0.05 of refractivity over a room.
VALUES = 0.05 * np.random.default_rng(0).normal(size=(5, 6, 4))


class Network(eqx.Module):
    mlp: eqx.nn.MLP

    def __call__(self, point_m):
        return 0.02 * self.mlp(point_m)


def network() -> FunctionField:
    mlp = eqx.nn.MLP(3, "scalar", 8, 2, jnp.tanh, dtype=jnp.float64, key=jax.random.key(0))
    return FunctionField(Network(mlp))


FIELDS = {
    "grid": lambda: GridField(ROOM.lower_m, ROOM.upper_m, jnp.asarray(VALUES)),
    "spline": lambda: jax.tree.map(jnp.asarray, through_vertices(ROOM.lower_m, ROOM.upper_m, VALUES)),
    "network": network,
}


@pytest.mark.parametrize("kind", FIELDS)
def test_gradients_agree_with_central_differences(kind):
    tracers = [t(12, N0) for t in (StraightTracer, QuasiLinearTracer, NonlinearTracer)]
    with jax.enable_x64(True):
        field = FIELDS[kind]()
        # From inside the room: at its face a field on vertices has a kink, which no difference can see.
        rays = rays_from((0.87, -1.03, 1.52), wall_points(5))
        inputs, still = eqx.partition((rays, field), eqx.is_inexact_array)
        weights = jnp.asarray(np.random.default_rng(1).normal(size=(5, 3)))

        def losses(moving):
            moved_rays, moved_field = eqx.combine(moving, still)
            bends = [t.bend(moved_rays, moved_field) for t in tracers]
            return jnp.stack([jnp.sum(weights * (b.wall_shift_m + 0.3 * b.turn)) for b in bends])

        flat, unravel = ravel_pytree(inputs)
        function = jax.jit(lambda x: losses(unravel(x)))
        jacobian = jax.jit(jax.jacrev(lambda x: losses(unravel(x))))(flat)
        rng = np.random.default_rng(2)
        for _ in range(2):
            way = jnp.asarray(rng.normal(size=flat.shape)) * jnp.maximum(jnp.abs(flat), 1e-3)
            # Fourth-order differences: truncation h^4, rounding 1e-16 / h.
            h = 1e-5
            near, far = (function(flat + s * h * way) - function(flat - s * h * way) for s in (1, 2))
            numeric = (8 * near - far) / (12 * h)
            assert np.asarray(jacobian @ way) == pytest.approx(np.asarray(numeric), rel=1e-6)


def test_memory_of_the_nonlinear_gradient_does_not_grow_with_the_steps():
    field = GridField(ROOM.lower_m, ROOM.upper_m, jnp.asarray(VALUES, jnp.float32))
    with jax.enable_x64(True):
        wide = rays_from((0.85, -2.0, 1.5), wall_points(200))
    rays = jax.tree.map(lambda a: jnp.asarray(np.asarray(a), jnp.float32 if a.dtype == float else None), wide)

    def bytes_needed(tracer) -> int:
        loss = lambda f: jnp.sum(tracer.bend(rays, f).wall_shift_m ** 2)  # noqa: E731
        return jax.jit(jax.grad(loss)).lower(field).compile().memory_analysis().temp_size_in_bytes

    short, long = bytes_needed(NonlinearTracer(8)), bytes_needed(NonlinearTracer(256))
    # One extra number a step for the loop's index.
    assert long < 1.1 * short + 8 * 256
