"""What a solver hands back: the air on a vertex grid, how it ended, and what it cost."""

from collections.abc import Mapping
from enum import Enum

import equinox as eqx
import numpy as np
from jaxtyping import Float


class Outcome(Enum):
    """How a solve ended; the value is the advice."""

    converged = "The solution settled."
    plateau = "The loss stopped falling; more iterations would not help."
    step_limit = "The iteration limit was reached. Raise it, or start from this result."
    time_limit = "The time limit was reached. Raise it, or start from this result."
    nonfinite = (
        "A value became infinite or not a number; the last good state is kept. "
        "Lower the learning rate or check the boundary data."
    )


class Solution(eqx.Module):
    """T, p, u on vertices (end planes included), index order [ix, iy, iz]; None where not solved for.

    Standard deviations are one sigma, on the same grid; `informed` is the share of the prior variance of
    T that the measurements removed (0: the model speaks alone). `history` holds one dict a recorded
    iteration: numbers, and in `doing` what was done.
    """

    x_m: Float[np.ndarray, " nx"]
    y_m: Float[np.ndarray, " ny"]
    z_m: Float[np.ndarray, " nz"]
    temperature_k: Float[np.ndarray, "nx ny nz"]
    pressure_m2_s2: Float[np.ndarray, "nx ny nz"] | None = None
    velocity_m_s: Float[np.ndarray, "nx ny nz 3"] | None = None
    temperature_std_k: Float[np.ndarray, "nx ny nz"] | None = None
    pressure_std_m2_s2: Float[np.ndarray, "nx ny nz"] | None = None
    velocity_std_m_s: Float[np.ndarray, "nx ny nz 3"] | None = None
    informed: Float[np.ndarray, "nx ny nz"] | None = None
    outcome: Outcome = eqx.field(static=True, default=Outcome.converged)
    solver_s: float = 0.0
    history: tuple[Mapping[str, float | str], ...] = eqx.field(static=True, default=())
    notes: tuple[str, ...] = eqx.field(static=True, default=())


class Derived(eqx.Module):
    """A quantity that follows from a solution, on its vertices; the ends of its 95 % interval where it has one."""

    name: str = eqx.field(static=True)
    unit: str = eqx.field(static=True)
    label: str = eqx.field(static=True)
    values: Float[np.ndarray, "nx ny nz"]
    low: Float[np.ndarray, "nx ny nz"] | None = None
    high: Float[np.ndarray, "nx ny nz"] | None = None
