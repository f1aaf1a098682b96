"""What a solver hands back: the air on a vertex grid, how it ended, and what it cost."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import Enum
from typing import cast

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from core.objects import RoomObject, inside_objects


class Outcome(Enum):
    """How a solve ended; the value is the advice."""

    converged = "The solution settled."
    unsteady = "The room's air still changed when its march ended: the result is the mean over its last part."
    plateau = "The loss stopped falling; more iterations would not help."
    step_limit = "The iteration limit was reached. Raise it, or start from this result."
    time_limit = "The time limit was reached. Raise it, or start from this result."
    nonfinite = (
        "A value became infinite or not a number; the last good state is kept. "
        "Lower the learning rate or check the boundary data."
    )


class Departures(eqx.Module):
    """T of every burst of a sequence less that of their mean, on the vertices of the mean's solution [K].

    `time_s` is when each burst began. The deviation is one sigma, the same for every burst, and does not hold the
    mean's. `field_std_k` and `field_length_m` are those of the random field that the departures were taken from.
    """

    time_s: Float[np.ndarray, " bursts"]
    temperature_k: Float[np.ndarray, "bursts nx ny nz"]
    temperature_std_k: Float[np.ndarray, "nx ny nz"]
    field_std_k: float = eqx.field(static=True)
    field_length_m: float = eqx.field(static=True)

    def without(self, inside: Bool[np.ndarray, "nx ny nz"]) -> "Departures":
        """The same with NaN at these vertices."""
        return replace(
            self,
            temperature_k=np.where(inside, np.nan, self.temperature_k).astype(np.float32),
            temperature_std_k=np.where(inside, np.nan, self.temperature_std_k).astype(np.float32),
        )

    @property
    def rms_k(self) -> Float[np.ndarray, "nx ny nz"]:
        """How much T fluctuates from burst to burst: what was found, and what may be more by the deviation."""
        return np.sqrt((self.temperature_k**2).mean(axis=0) + self.temperature_std_k**2)


class Solution(eqx.Module):
    """T, p, u on vertices (end planes included), index order [ix, iy, iz]; None where not solved for.

    Standard deviations are one sigma, on the same grid. `temperature_shared_k` are errors of T that all places
    have together: each is one sigma of an error that is independent of the others, and `temperature_std_k` holds
    them. It is None where nobody knows how the errors of two places go together. `informed` is the share of the
    prior variance of T that the measurements removed (0: the model speaks alone). `departures` are those of the
    bursts of a sequence, of which the solution is the mean. `history` holds one dict a recorded iteration:
    numbers, and in `doing` what was done. All fields are NaN in and on objects, which hold no air.
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
    temperature_shared_k: Float[np.ndarray, "nx ny nz errors"] | None = None
    departures: Departures | None = None
    outcome: Outcome = eqx.field(static=True, default=Outcome.converged)
    solver_s: float = 0.0
    history: tuple[Mapping[str, float | str], ...] = eqx.field(static=True, default=())
    notes: tuple[str, ...] = eqx.field(static=True, default=())

    @property
    def air(self) -> Bool[np.ndarray, "nx ny nz"]:
        """Where there is air: everywhere but in and on objects."""
        return ~np.isnan(self.temperature_k)

    def without_objects(self, objects: Sequence[RoomObject]) -> "Solution":
        """The same with NaN in and on these objects."""
        if not objects:
            return self
        inside = inside_objects(objects, (self.x_m, self.y_m, self.z_m))

        def masked(field: np.ndarray | None) -> np.ndarray | None:
            if field is None:
                return None
            return np.where(inside if field.ndim == 3 else inside[..., None], np.nan, field).astype(
                field.dtype
            )

        fields = {name: masked(getattr(self, name)) for name in _FIELDS}
        return replace(self, departures=self.departures and self.departures.without(inside), **fields)

    def filled(self) -> "Solution":
        """For what needs a number everywhere: in objects the nearest air's values, and no velocity."""
        if self.air.all():
            return self
        solid = ~self.air
        nearest = ndimage.distance_transform_edt(solid, return_distances=False, return_indices=True)
        places = tuple(cast("np.ndarray", nearest))
        fields = {name: getattr(self, name) for name in _FIELDS}
        full = {name: None if field is None else field[places] for name, field in fields.items()}
        if self.velocity_m_s is not None:
            full["velocity_m_s"] = np.where(solid[..., None], 0.0, self.velocity_m_s).astype(
                self.velocity_m_s.dtype
            )
        return replace(self, **full)


_FIELDS = (
    "temperature_k", "pressure_m2_s2", "velocity_m_s", "temperature_std_k", "pressure_std_m2_s2",
    "velocity_std_m_s", "informed", "temperature_shared_k",
)  # fmt: skip


class Derived(eqx.Module):
    """A quantity that follows from a solution, on its vertices; the ends of its 95 % interval where it has one."""

    name: str = eqx.field(static=True)
    unit: str = eqx.field(static=True)
    label: str = eqx.field(static=True)
    values: Float[np.ndarray, "nx ny nz"]
    low: Float[np.ndarray, "nx ny nz"] | None = None
    high: Float[np.ndarray, "nx ny nz"] | None = None
