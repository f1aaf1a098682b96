"""A network that begins as another solver's solution, such as a marched room's."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PyTree

from core.losses.representation import points_of
from core.mlp import Mlp
from core.result import Solution
from core.setting import SettingError
from core.solve.nondimensional import RoomFrame

_POINTS, _RATE = 4096, 5e-3


def network_like(network: Mlp, solution: Solution, frame: RoomFrame, *, steps: int, seed: int) -> Mlp:
    """`network` fitted to a solution's T, p and u at its vertices, `steps` mini-batches by Adam.

    Raises SettingError for a solution without p and u.
    """
    if solution.pressure_m2_s2 is None or solution.velocity_m_s is None:
        raise SettingError(
            "A network begins from T, p and u; this solution has no velocity. Start from a room or a grid."
        )
    scales = frame.scales
    shape = solution.temperature_k.shape
    points = jnp.asarray(points_of(frame.vertices(shape)), jnp.float32)
    wanted = np.concatenate(
        [
            (solution.temperature_k[..., None] - scales.reference_k) / scales.excess_k,
            solution.pressure_m2_s2[..., None] / scales.pressure_m2_s2,
            solution.velocity_m_s / scales.velocity_m_s,
        ],
        axis=-1,
    ).reshape(-1, 5)
    # Every quantity in its own spread, so that none waits for another.
    spread = jnp.asarray(wanted.std(axis=0) + 1e-12, jnp.float32)
    optimiser = optax.adam(lambda n: 0.5 * _RATE * (1.0 + jnp.cos(jnp.pi * jnp.float32(n) / steps)))
    with jax.numpy_dtype_promotion("standard"):  # Optax mixes its integer step count with floats
        return _fitted(network, points, jnp.asarray(wanted, jnp.float32), spread, optimiser, steps, seed)


@eqx.filter_jit
def _fitted(
    network: Mlp,
    points: Float[Array, "points 3"],
    wanted: Float[Array, "points 5"],
    spread: Float[Array, "5"],
    optimiser: optax.GradientTransformation,
    steps: int,
    seed: int,
) -> Mlp:
    arrays, rest = eqx.partition(network, eqx.is_inexact_array)

    def misfit(arrays: Mlp, key: Array) -> Float[Array, ""]:
        own = jax.random.randint(key, (min(_POINTS, len(points)),), 0, len(points))
        found = eqx.combine(arrays, rest).at(points[own])
        values = jnp.concatenate([found.temperature[:, None], found.pressure[:, None], found.velocity], 1)
        return jnp.mean(((values - wanted[own]) / spread[None, :]) ** 2)

    def step(carry: tuple[Mlp, PyTree], key: Array) -> tuple[tuple[Mlp, PyTree], None]:
        arrays, state = carry
        change, state = optimiser.update(jax.grad(misfit)(arrays, key), state)
        return (eqx.apply_updates(arrays, change), state), None

    keys = jax.random.split(jax.random.key(seed), steps)
    (arrays, _), _ = jax.lax.scan(step, (arrays, optimiser.init(arrays)), keys)
    return eqx.combine(arrays, rest)
