"""Snapshots of air that moves: the NPZ that stands beside a room volume.

Arrays: `time_s` (n, increasing), `x`, `y`, `z` (evenly spaced vertices [m], end planes included), `T`
(n, nx, ny, nz), in kelvin above `T0`. Other arrays, such as the velocity, may be there; a picture does not need them.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float

from app.errors import BadInputError
from app.files.npz import read_npz
from app.files.reading import reading
from core.geometry import Box

_WHAT_TO_DO = "Export the snapshots again."
_NAMES = ("time_s", "x", "y", "z", "T", "T0")


@dataclass(frozen=True)
class Snapshots:
    """Temperatures of a room at several moments, the first of which is time 0."""

    time_s: Float[np.ndarray, " n"]
    temperature_k: Float[np.ndarray, "n nx ny nz"]

    def nearest(self, time_s: float) -> int:
        """The snapshot nearest to a moment; after the last one the record begins again."""
        step_s = float(self.time_s[-1] / (len(self.time_s) - 1))
        within_s = time_s % (float(self.time_s[-1]) + step_s)
        return int(np.argmin(np.abs(self.time_s - within_s)))


def read_snapshots(path: Path, room: Box) -> Snapshots:
    """Read and check the snapshots of this room. Raises BadInputError for anything else."""
    if not path.is_file():
        raise BadInputError(f"There are no snapshots {path}. Give an NPZ file with {', '.join(_NAMES)}.")
    return _read(path, room, path.stat().st_mtime_ns)


@lru_cache(maxsize=1)
def _read(path: Path, room: Box, _changed_ns: int) -> Snapshots:
    with reading(path, _WHAT_TO_DO):
        return _checked(path, read_npz(path, _WHAT_TO_DO), room)


def _checked(path: Path, arrays: dict[str, np.ndarray], room: Box) -> Snapshots:
    missing = [name for name in _NAMES if name not in arrays]
    if missing:
        raise BadInputError(
            f"{path} has no {', '.join(missing)}; expected {', '.join(_NAMES)}. {_WHAT_TO_DO}"
        )
    time_s = np.asarray(arrays["time_s"], np.float64)
    axes = [np.asarray(arrays[name], np.float64) for name in "xyz"]
    if time_s.ndim != 1 or len(time_s) < 2 or not np.all(np.diff(time_s) > 0):
        raise BadInputError(
            f"{path}: time_s has shape {time_s.shape}; expected at least two increasing moments. {_WHAT_TO_DO}"
        )
    shape = (len(time_s), *(axis.size for axis in axes))
    if arrays["T"].shape != shape:
        raise BadInputError(f"{path}: T has shape {arrays['T'].shape}; expected {shape}. {_WHAT_TO_DO}")
    for name, axis, low_m, high_m in zip("xyz", axes, room.lower_m, room.upper_m, strict=True):
        even = np.linspace(low_m, high_m, axis.size)
        if axis.size < 2 or not np.allclose(axis, even, atol=1e-3 * (high_m - low_m)):
            raise BadInputError(
                f"{path}: {name} goes from {axis.min():g} to {axis.max():g} m; expected evenly spaced vertices "
                f"from {low_m:g} to {high_m:g} m, as the room has. Is it another room's?"
            )
    if not np.isfinite(arrays["T"]).all():
        raise BadInputError(f"{path}: T holds values that are not finite. {_WHAT_TO_DO}")
    return Snapshots(time_s - time_s[0], arrays["T"] + np.float32(arrays["T0"]))
