"""The one interface of the tracers: rays and a field in, how the rays bend out."""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from core.fields import AbstractField
from core.rays.bundle import RayOutcome, Rays


class Bend(eqx.Module):
    """How rays left their straight paths, for rays that end on the back wall; zero for all others.

    `wall_shift_m` lies in the wall (its y is 0): where the bent ray lands minus where the straight one
    would have. `turn` is v / eta0 at the wall minus the straight direction: across the ray, the
    deflection angle [rad].
    """

    wall_shift_m: Float[Array, "rays 3"]
    turn: Float[Array, "rays 3"]
    outcome: Int[Array, " rays"]


class AbstractRayTracer(eqx.Module):
    """Integrates dx/dt = v, dv/dt = eta grad eta (paper, eq. 1) as a deviation from the straight ray.

    With m = (N - N0) / (1 + N0), s = (1 + N0) t and the straight ray x0 + s d:

        x = x0 + s d + delta,    delta' = u,    u' = (1 + m) grad m,    u(0) = m(x0) d.

    A ray starts at its entry with the camera's direction: refraction at the clear front of the room is
    left out, as in the paper (it is a uniform magnification, which a drift fit removes).
    """

    @abstractmethod
    def bend(self, rays: Rays, field: AbstractField) -> Bend:
        """Trace every ray to the back wall."""


# A ray that has turned by more than this against the straight one's advance is no picture of the wall.
_LEAST_ADVANCE = 0.05


def land(
    rays: Rays,
    turn: Float[Array, "rays 3"],
    deviation_m: Float[Array, "rays 3"],
    final: Float[Array, "rays 3"],
) -> Bend:
    """Cut the end of each path, moved by `deviation_m` and heading along `final`, with the back wall.

    A ray that no longer advances to the wall, or whose deviation is not finite, has turned back.
    """
    finite = jnp.all(jnp.isfinite(deviation_m) & jnp.isfinite(final), axis=-1)
    arrives = finite & (final[:, 1] > _LEAST_ADVANCE * rays.direction[:, 1])
    arrives = arrives & (jnp.abs(deviation_m[:, 1]) < rays.length_m * jnp.abs(rays.direction[:, 1]) + 1e-30)
    hit = (rays.on_wall & arrives)[:, None]
    # Chosen before the division: a gradient through an unused branch would still be NaN.
    final, deviation_m = jnp.where(hit, final, 1.0), jnp.where(hit, deviation_m, 0.0)
    shift_m = deviation_m - (deviation_m[:, 1] / final[:, 1])[:, None] * final
    in_wall = shift_m * jnp.asarray([1.0, 0.0, 1.0], shift_m.dtype)[None]
    outcome = jnp.where(rays.on_wall & ~arrives, RayOutcome.turned_back, rays.outcome)
    return Bend(jnp.where(hit, in_wall, 0.0), jnp.where(hit, turn, 0.0), outcome.astype(jnp.int32))
