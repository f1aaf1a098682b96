"""Paths of particles through the found flow, for ParaView: polylines with the time along them."""

from pathlib import Path

import numpy as np
from pyevtk.hl import polyLinesToVTK

from app.errors import BadInputError
from core.result import Solution
from core.streamlines import Paths, particle_paths

STARTS = (5, 4, 5)


def write_vtu(path: Path, solution: Solution) -> None:
    """Write paths from an even lattice of starts; each carries how long its particle stayed.

    A particle is followed for as long as the mean speed needs for ten room diagonals. Raises BadInputError for
    a result without velocity, and for still air.
    """
    if solution.velocity_m_s is None:
        raise BadInputError(
            "This result has no velocity to follow. Solve with a preset that finds it: standard."
        )
    solution = solution.filled()
    velocity_m_s = np.asarray(solution.velocity_m_s, np.float64)
    speed_m_s = float(np.sqrt(np.mean(np.sum(np.square(velocity_m_s), axis=-1))))
    if speed_m_s == 0.0:
        raise BadInputError("The air of this result stands still everywhere: there is no path to draw.")
    axes = (solution.x_m, solution.y_m, solution.z_m)
    limit_s = 10 * float(np.linalg.norm([axis[-1] - axis[0] for axis in axes])) / speed_m_s
    _write(path, particle_paths(solution, starts_m(solution), limit_s))


def starts_m(solution: Solution) -> np.ndarray:
    """Middles of an even division of the room."""
    axes = (solution.x_m, solution.y_m, solution.z_m)
    middles = [
        axis[0] + (axis[-1] - axis[0]) * (np.arange(count) + 0.5) / count
        for axis, count in zip(axes, STARTS, strict=True)
    ]
    return np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float64)


def _write(path: Path, paths: Paths) -> None:
    there = np.isfinite(paths.positions_m[..., 0])
    points_m = paths.positions_m[there]
    ages_s = np.broadcast_to(paths.times_s, there.shape)[there]
    x, y, z = (np.ascontiguousarray(points_m[:, axis]) for axis in range(3))
    polyLinesToVTK(
        str(path.with_suffix("")),
        x,
        y,
        z,
        pointsPerLine=there.sum(axis=1),
        pointData={"age_s": np.ascontiguousarray(ages_s)},
        cellData={"residence_s": paths.residence_s, "left": paths.left.astype(np.float64)},
    )
