"""A result beside what is known better: the truth of a simulated room, and readings of point sensors."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.interpolate import RegularGridInterpolator
from scipy.special import ndtri

from app.experiment.boundary import read_sensors
from app.experiment.folder import Experiment
from app.volume.file import Beside, read_volume
from app.volume.score import score_solution, truth_at
from core.comfort import CELSIUS_K
from core.result import Solution
from core.significance import FALSE_ALARMS


@dataclass(frozen=True)
class Reading:
    """One quantity at one sensor: measured with its standard deviation, and found there with its own, 0 without."""

    name: str
    unit: str
    position_m: tuple[float, float, float]
    measured: float
    std: float
    found: float
    found_std: float


def beside_truth(solution: Solution, path: Path) -> list[Beside]:
    """Every solved quantity beside the truth in `path`; p about its own mean, since its level is free."""
    truth = read_volume(path)
    found = [
        ("T", "K", "temperature", solution.temperature_k, truth_at(truth, solution, truth.temperature_k))
    ]
    for index, axis in enumerate("xyz"):
        if solution.velocity_m_s is not None:
            values = truth_at(truth, solution, truth.velocity_m_s[..., index])
            own = solution.velocity_m_s[..., index]
            found.append(("uvw"[index], "m s-1", f"velocity along {axis}", own, values))
    if solution.pressure_m2_s2 is not None:
        values = truth_at(truth, solution, truth.pressure_m2_s2)
        own = solution.pressure_m2_s2
        level = np.nanmean(own - values)
        found.append(("p", "m2 s-2", "kinematic pressure", own, values + level))
    return [Beside(name, unit, label, true, own - true) for name, unit, label, own, true in found]


def scores(solution: Solution, path: Path) -> dict[str, Any]:
    """The project's yardstick: see `core.metrics`."""
    return score_solution(solution, read_volume(path))


def readings(experiment: Experiment, solution: Solution) -> list[Reading]:
    """What the scene's point sensors measured, beside what was found there. Raises BadInputError."""
    told = []
    solution = solution.filled()
    for sensors in read_sensors(experiment, experiment.settings.scene):
        field_k, std_k = solution.temperature_k, solution.temperature_std_k
        columns = [("T", "K", sensors.temperature_k, sensors.temperature_std_k, field_k, std_k)]
        if solution.velocity_m_s is not None:
            for i, name in enumerate("uvw"):
                measured, field = sensors.velocity_m_s[:, i], solution.velocity_m_s[..., i]
                own = None if solution.velocity_std_m_s is None else solution.velocity_std_m_s[..., i]
                columns.append((name, "m s-1", measured, sensors.velocity_std_m_s, field, own))
        axes = (solution.x_m, solution.y_m, solution.z_m)
        for name, unit, measured, std, field, own in columns:
            there, own_there = (
                RegularGridInterpolator(axes, np.asarray(of, np.float64))(sensors.position_m)
                for of in (field, np.zeros_like(field) if own is None else own)
            )
            told += [
                Reading(name, unit, _triple(place), float(m), float(s), float(f), float(o))
                for place, m, s, f, o in zip(sensors.position_m, measured, std, there, own_there, strict=True)
                if np.isfinite(m)
            ]
    return told


def left_thermometers(experiment: Experiment, solution: Solution) -> tuple[str, ...]:
    """Sentences on the thermometers whose reading the result leaves by more than both deviations together allow.

    Where all are right, at most one result in twenty has such a sentence. The one that is farthest off is first: a
    wrong one pulls the result away from others too. Raises BadInputError.
    """
    off = {
        one: abs(one.found - one.measured) / float(np.hypot(one.std, one.found_std))
        for one in readings(experiment, solution)
        if one.name == "T"
    }
    most = float(ndtri(1.0 - 0.5 * FALSE_ALARMS / max(len(off), 1)))
    return tuple(
        f"The thermometer at ({', '.join(f'{x:.2f}' for x in one.position_m)}) m reads "
        f"{one.measured - CELSIUS_K:.1f} °C; the result has {one.found - CELSIUS_K:.1f} °C there, which is "
        f"{off[one]:.1f} times as far as the reading and the result may be off (one deviation). "
        "Check that thermometer."
        for one in sorted(off, key=lambda one: -off[one])
        if off[one] > most
    )


def _triple(place: Float[np.ndarray, "3"]) -> tuple[float, float, float]:
    x, y, z = map(float, place)
    return x, y, z
