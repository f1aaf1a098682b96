"""`score`: a result against the truth, beside the trivial answers."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.interpolate import RegularGridInterpolator

from app.experiment.folder import open_experiment, read_manifest
from app.experiment.results import read_result
from app.volume.file import RoomVolume, filled, read_volume
from app.volume.score_bursts import score_bursts
from core.metrics import inner, mean_of_air, score_pressure, score_temperature, score_velocity
from core.result import Solution
from core.significance import EITHER_WAY


def score_experiment(folder: Path, truth_path: Path, result: Path | None = None) -> dict[str, Any]:
    """Score the newest (or the given) result of an experiment. Raises BadInputError."""
    experiment = open_experiment(folder)
    result_folder = experiment.result(result)
    solution = read_result(result_folder / "result.nc")
    scores = score_solution(solution, read_volume(truth_path))
    manifest = read_manifest(result_folder)
    return {
        "experiment": str(folder),
        "result": result_folder.name,
        "preset": manifest.get("preset"),
        "information": experiment.settings.information,
        **scores,
        **coverage(solution, read_volume(truth_path)),
        "bursts": score_bursts(experiment, manifest.get("bursts", []), solution),
        "outcome": solution.outcome.name,
        "solver_s": solution.solver_s,
        "wall_s": manifest.get("wall_s"),
    }


def score_solution(solution: Solution, truth: RoomVolume) -> dict[str, Any]:
    """T, u, p scores at the truth's vertices of air; u and p are None where the solution has none."""
    true_k, true_m_s, true_p = (
        in_air(truth, v) for v in (truth.temperature_k, truth.velocity_m_s, truth.pressure_m2_s2)
    )
    temperature = values_at(truth, solution, solution.temperature_k)
    scores: dict[str, Any] = {
        "T": score_temperature(temperature, true_k, truth.ambient_k),
        "u": None,
        "p": None,
    }
    if solution.velocity_m_s is not None:
        supply = max((abs(i["U"]) for i in truth.case.get("inlets", [])), default=0.0)
        supply = supply or float(np.linalg.norm(truth.velocity_m_s, axis=-1).max())
        scores["u"] = score_velocity(values_at(truth, solution, solution.velocity_m_s), true_m_s, supply)
    if solution.pressure_m2_s2 is not None:
        scores["p"] = score_pressure(
            in_air(truth, values_at(truth, solution, solution.pressure_m2_s2)), true_p
        )
    return scores


def coverage(solution: Solution, truth: RoomVolume) -> dict[str, float | None]:
    """Share of the inner points whose truth is in its 95 % interval, or None; p is compared about its mean."""

    def within(found: Any, std: Any, values: np.ndarray, *, level: bool = True) -> float | None:
        if found is None or std is None:
            return None
        error = inner(values_at(truth, solution, found)) - inner(in_air(truth, values))
        error = error if level else error - mean_of_air(error)
        held = np.abs(error) <= EITHER_WAY * inner(values_at(truth, solution, std))
        return float(np.mean(held[~np.isnan(error)]))

    s = solution
    return {
        "T_within": within(s.temperature_k, s.temperature_std_k, truth.temperature_k),
        "u_within": within(s.velocity_m_s, s.velocity_std_m_s, truth.velocity_m_s),
        "p_within": within(s.pressure_m2_s2, s.pressure_std_m2_s2, truth.pressure_m2_s2, level=False),
    }


def in_air(truth: RoomVolume, values: np.ndarray) -> np.ndarray:
    """Values on the truth's vertices, NaN in and on its obstacles."""
    if truth.solid is None:
        return values
    solid = truth.solid if values.ndim == 3 else truth.solid[..., None]
    return np.where(solid, np.nan, values)


def values_at(truth: RoomVolume, solution: Solution, values: np.ndarray) -> np.ndarray:
    """The solution's values at the truth's vertices (trilinear; the nearest wall outside the box).

    Where the solution has no air, NaN, the nearest air's values are taken: what counts is where the truth has air.
    """
    unknown = np.isnan(values if values.ndim == 3 else values[..., 0])
    values = filled(values, unknown) if unknown.any() else values
    axes = (solution.x_m, solution.y_m, solution.z_m)
    points = [
        np.clip(axis, own[0], own[-1])
        for axis, own in zip((truth.x_m, truth.y_m, truth.z_m), axes, strict=True)
    ]
    mesh = np.stack(np.meshgrid(*points, indexing="ij"), axis=-1)
    return RegularGridInterpolator(axes, np.asarray(values, np.float64))(mesh)


def truth_at(
    truth: RoomVolume, solution: Solution, values: Float[np.ndarray, "tx ty tz"]
) -> Float[np.ndarray, "nx ny nz"]:
    """The truth's values at the solution's vertices; the nearest wall outside the truth's box."""
    axes = (truth.x_m, truth.y_m, truth.z_m)
    points = [
        np.clip(own, axis[0], axis[-1])
        for own, axis in zip((solution.x_m, solution.y_m, solution.z_m), axes, strict=True)
    ]
    mesh = np.stack(np.meshgrid(*points, indexing="ij"), axis=-1)
    return RegularGridInterpolator(axes, np.asarray(values, np.float64))(mesh)
