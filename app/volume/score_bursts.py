"""The bursts of a sequence against the snapshots that a simulated camera looked at."""

from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.interpolate import RegularGridInterpolator

from app.experiment.folder import Experiment, read_manifest
from app.experiment.rig_settings import SimulatedCameraSettings
from app.volume.snapshots import Snapshots, read_snapshots
from core.geometry import Box
from core.metrics import inner
from core.result import Solution
from core.significance import EITHER_WAY


def score_bursts(experiment: Experiment, bursts: list[str], solution: Solution) -> dict[str, Any] | None:
    """How well T in single bursts is known, at the snapshots' inner vertices; None where there are no snapshots.

    `rms_K` is the error of the bursts, `mean_rms_K` that of the mean taken for each of them. `departure_rel` is the
    error of the departures from the mean, in parts of their size: 1 where they are not seen at all. `within` is the
    share of the points in their 95 % interval. Raises BadInputError.
    """
    camera, found = experiment.settings.rig.camera, solution.departures
    if found is None or not isinstance(camera, SimulatedCameraSettings) or camera.snapshots is None:
        return None
    room = experiment.settings.scene.room
    snapshots = read_snapshots(experiment.file(camera.snapshots), room)
    true_k = np.stack([_true_k(experiment, name, snapshots) for name in bursts])
    mean_k, std_k, own_std_k = (
        _at(solution, values, room, true_k.shape[1:])
        for values in (solution.temperature_k, solution.temperature_std_k, found.temperature_std_k)
    )
    departures_k = np.stack([_at(solution, one, room, true_k.shape[1:]) for one in found.temperature_k])
    error_k = inner(np.moveaxis(mean_k + departures_k - true_k, 0, -1))
    moved_k = inner(np.moveaxis(true_k - true_k.mean(axis=0), 0, -1))
    missed_k = inner(np.moveaxis(departures_k, 0, -1)) - moved_k
    held = np.abs(error_k) <= EITHER_WAY * inner(np.hypot(std_k, own_std_k))[..., None]
    return {
        "rms_K": _rms(error_k),
        "mean_rms_K": _rms(inner(np.moveaxis(mean_k - true_k, 0, -1))),
        "departure_rel": _rms(missed_k) / _rms(moved_k),
        "within": float(np.mean(held[~np.isnan(error_k)])),
    }


def _true_k(experiment: Experiment, burst: str, snapshots: Snapshots) -> Float[np.ndarray, "nx ny nz"]:
    """The mean over the moments of a burst's frames."""
    records = read_manifest(experiment.captures_folder / burst)["views"][0]["records"]
    seen = [snapshots.nearest(float(record["timestamp_s"])) for record in records]
    return snapshots.temperature_k[seen].mean(axis=0)


def _at(
    solution: Solution, values: np.ndarray | None, room: Box, shape: tuple[int, ...]
) -> Float[np.ndarray, "nx ny nz"]:
    """Values on evenly spaced vertices of the room: linear, the nearest beyond the ends."""
    if values is None:
        return np.zeros(shape)
    axes = (solution.x_m, solution.y_m, solution.z_m)
    ends = zip(room.lower_m, room.upper_m, shape, axes, strict=True)
    points = [np.clip(np.linspace(low, high, n), own[0], own[-1]) for low, high, n, own in ends]
    mesh = np.stack(np.meshgrid(*points, indexing="ij"), axis=-1)
    return RegularGridInterpolator(axes, np.asarray(values, np.float64))(mesh)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
