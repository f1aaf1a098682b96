"""Where a found flow carries air: paths of particles without inertia, and how long each stays in the room.

    dx/dt = u(x),  u between vertices by trilinear interpolation

by Tsitouras' fifth-order pair with step control in float64: a particle takes long steps in a calm core and short
ones in a jet, and its leaving through a wall's opening is found as a root, not to a step. Turbulence is not in it:
these are the paths of the mean flow, so the times are those of a tracer that does not spread.
"""

from typing import Any, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jax.scipy.ndimage import map_coordinates
from jaxtyping import Array, Bool, Float, PyTree

from core.result import Solution

MAX_STEPS = 8192


class Paths(eqx.Module):
    """Positions at even times (NaN once a particle has left), time until it left, and whether it did.

    Where `left` is false, `residence_s` is how long the particle was followed.
    """

    times_s: Float[np.ndarray, " times"]
    positions_m: Float[np.ndarray, "particles times 3"]
    residence_s: Float[np.ndarray, " particles"]
    left: Bool[np.ndarray, " particles"]


def particle_paths(
    solution: Solution,
    starts_m: Float[np.ndarray, "particles 3"],
    limit_s: float,
    times: int = 200,
    tolerance: float = 1e-9,
) -> Paths:
    """Follow particles from points within the room until they leave it, at most for `limit_s`.

    `tolerance` is the error of a step, as a share of the room. Raises ValueError without a velocity.
    """
    if solution.velocity_m_s is None:
        raise ValueError(
            "This result has no velocity to follow. Solve with a preset that finds it: standard."
        )
    axes = (solution.x_m, solution.y_m, solution.z_m)
    low_m = np.array([axis[0] for axis in axes], np.float64)
    high_m = np.array([axis[-1] for axis in axes], np.float64)
    # A particle that starts on a face would leave through it at once.
    inside_m = 1e-9 * (high_m - low_m)
    starts_m = np.clip(starts_m.astype(np.float64), low_m + inside_m, high_m - inside_m)
    with jax.enable_x64(True):
        velocity = jnp.asarray(solution.velocity_m_s, jnp.float64)
        times_s = jnp.linspace(0.0, limit_s, times)
        found = _follow(
            velocity, jnp.asarray(starts_m), jnp.asarray(low_m), jnp.asarray(high_m), times_s, tolerance
        )
        end_s, positions_m, left = (np.asarray(part) for part in found)
    positions_m = np.where(np.isfinite(positions_m), positions_m, np.nan)
    return Paths(np.asarray(times_s), positions_m, end_s, left)


@eqx.filter_jit
def _follow(
    velocity_m_s: Float[Array, "nx ny nz 3"],
    starts_m: Float[Array, "particles 3"],
    low_m: Float[Array, "3"],
    high_m: Float[Array, "3"],
    times_s: Float[Array, " times"],
    tolerance: float,
) -> tuple[Float[Array, " particles"], Float[Array, "particles times 3"], Bool[Array, " particles"]]:
    cells = jnp.asarray(velocity_m_s.shape[:3], jnp.float64) - 1.0
    components = jnp.moveaxis(velocity_m_s, -1, 0)

    def rate(time_s: Any, at_m: Any, nothing: PyTree) -> Array:
        index = list((at_m - low_m) / (high_m - low_m) * cells)
        return jnp.stack([map_coordinates(part, index, order=1, mode="nearest") for part in components])

    def depth(t: Any, y: Any, args: PyTree, **state: Any) -> Array:
        """How far the point `y` lies within the room, as a share of it; zero on a wall."""
        return jnp.min(jnp.minimum(y - low_m, high_m - y) / (high_m - low_m))

    def one(start_m: Array) -> tuple[Array, Array, Array]:
        solved = diffrax.diffeqsolve(
            diffrax.ODETerm(rate),
            diffrax.Tsit5(),
            t0=times_s[0],
            t1=times_s[-1],
            dt0=None,
            y0=start_m,
            saveat=diffrax.SaveAt(subs=[diffrax.SubSaveAt(t1=True), diffrax.SubSaveAt(ts=times_s)]),
            stepsize_controller=diffrax.PIDController(
                rtol=tolerance, atol=tolerance * jnp.max(high_m - low_m)
            ),
            event=diffrax.Event(depth, root_finder=optimistix.Newton(rtol=1e-10, atol=1e-10)),
            max_steps=MAX_STEPS,
            throw=False,
        )
        ends_s, rows_m = cast(tuple[Array, Array], solved.ts), cast(tuple[Array, Array], solved.ys)
        return ends_s[0][-1], rows_m[1], cast(Array, solved.event_mask)

    return jax.vmap(one)(starts_m)
