"""The one interface of the tracers: rays and a field in, how the rays bend out."""

from abc import abstractmethod

import equinox as eqx
from jaxtyping import Array, Float, Int

from core.fields import AbstractField
from core.rays.bundle import Rays


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
