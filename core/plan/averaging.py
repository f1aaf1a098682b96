"""How long to average air that moves, before anybody measures: from the turbulence of the expected flow.

Where turbulence stirs a gradient of the mean temperature as fast as what it stirred decays, T departs from its mean
by

    T'^2 = 2 R nu_t / Pr_t (k / eps) |grad T|^2,    R = 1/2,

with R the ratio of the times in which the departures of T and of the velocity decay (Beguier, Dekeyser and Launder
1978). At one place T stays alike for about

    tau = 0.43 l / sqrt(U^2 + 2 k / 3),    l = k^(3/2) / eps

(Pope 2000, figure 6.24, carried by at the mean and the turbulent speed; l at most as long as the room is wide). A
mean over the time t then differs from that over a long one by T' sqrt(2 tau / t (1 - tau / t (1 - exp(-t / tau)))).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import root_scalar

from core.room.k_epsilon import C_MU, TURBULENT_PRANDTL
from core.room.room_grid import AXES, RoomGrid
from core.room.step import Flow

Cells = Float[np.ndarray, "nx ny nz"]

_TIME_RATIO = 0.5
_LENGTH = 0.43


@dataclass(frozen=True)
class Fluctuation:
    """How far T departs from its mean (rms over the room), and for how long it stays so at one place."""

    std_k: float
    time_s: float

    def error_k(self, averaged_s: float) -> float:
        """Rms over the room of a mean over so long a time, less that over a long time."""
        share = self.time_s / averaged_s
        return self.std_k * float(np.sqrt(2.0 * share * (1.0 - share * -np.expm1(-1.0 / share))))

    def seconds_for(self, error_k: float) -> float:
        """How long to average for so small an error; no time at all where one moment has none larger."""
        if error_k >= self.std_k:
            return 0.0
        longest_s = 2.0 * self.time_s * (self.std_k / error_k) ** 2
        bracket = (1e-6 * longest_s, longest_s)
        found = root_scalar(lambda averaged_s: self.error_k(averaged_s) - error_k, bracket=bracket)
        return float(found.root)

    def round_errors_k(self) -> list[float]:
        """Round numbers below the departures, to say how long to average for each."""
        decade = 10.0 ** np.floor(np.log10(self.std_k))
        steps = decade * np.array([5.0, 2.0, 1.0, 0.5, 0.2, 0.1])
        return [float(f"{step:.1g}") for step in steps if step < self.std_k][:3]


def fluctuation(
    mean: Flow, grid: RoomGrid, air: Bool[np.ndarray, "nx ny nz"] | None = None
) -> Fluctuation | None:
    """Of a marched room; None where its closure has no turbulent energy. `air` is false in objects."""
    if mean.turbulence is None:
        return None
    air = np.ones(np.shape(mean.excess_k), bool) if air is None else air
    energy, decay = (
        np.asarray(cells, np.float64)
        for cells in (mean.turbulence.energy_m2_s2, mean.turbulence.dissipation_m2_s3)
    )
    squared_speed = sum(_at_cells(np.asarray(mean.velocity[axis], np.float64), axis) ** 2 for axis in AXES)
    length_m = np.minimum(
        energy**1.5 / decay, min(n * h for n, h in zip(air.shape, grid.spacing_m, strict=True))
    )
    # nu_t k / eps = C l^2.
    variance = 2.0 * _TIME_RATIO * C_MU / TURBULENT_PRANDTL * length_m**2
    variance = np.where(air, variance * _squared_slope(np.asarray(mean.excess_k, np.float64), grid, air), 0.0)
    time_s = _LENGTH * length_m / np.sqrt(squared_speed + 2.0 / 3.0 * energy)
    total = float(variance.sum())
    if total <= 0.0:
        return None
    return Fluctuation((total / air.sum()) ** 0.5, float((time_s * variance).sum()) / total)


def _at_cells(faces: Float[np.ndarray, "..."], axis: int) -> Cells:
    """The mean of both faces of every cell."""
    faces = np.moveaxis(faces, axis, 0)
    return np.moveaxis(0.5 * (faces[1:] + faces[:-1]), 0, axis)


def _squared_slope(values: Cells, grid: RoomGrid, air: Bool[np.ndarray, "nx ny nz"]) -> Cells:
    """Squared length of the gradient, beside objects without its part across them."""
    total = np.zeros_like(values)
    for axis in AXES:
        slope = np.gradient(values, grid.spacing_m[axis], axis=axis)
        inside = np.pad(air, [(1, 1) if a == axis else (0, 0) for a in AXES], mode="edge")
        before, after = (
            np.take(inside, np.arange(start, start + values.shape[axis]), axis) for start in (0, 2)
        )
        total += np.where(before & after, slope, 0.0) ** 2
    return total
