"""The thermal layer on the wall before each camera, as errors that a view's shifts share.

Every ray crosses it at a slant of its own. From 4 m it makes most of the signal, and it is thinner than any cell of
`draft`, whose air is smooth along the view. The jump of the temperature across it is taken as linear over the height,
unknown within the range of the air that is known.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from core.geometry import WALLS, WallName
from core.known import stated_walls
from core.known_temperature import EVEN_STD, VertexGrid, on_wall
from core.problem import Problem
from core.solve.draft.temperature_prior import profile_range_k
from core.solve.draft.temperature_system import ShiftOperator


def front_layers_px(
    problem: Problem, operators: Sequence[ShiftOperator], grid: VertexGrid, per_k: float
) -> list[Float[np.ndarray, "windows 2 errors"]]:
    """Errors of one standard deviation of each view's shifts; none before an adiabatic wall."""
    walls, jump_k = stated_walls(problem.scene), EVEN_STD * profile_range_k(problem)
    found = []
    for view, operator, shift in zip(problem.scene.views, operators, problem.shifts, strict=True):
        front, errors = _opposite(view.wall), []
        stated = walls[front]
        if stated is None or stated.thermal != "adiabatic":
            for jump in _jumps(front, grid):
                layer = np.zeros(grid.shape)
                on_wall(front, layer)[...] = per_k * jump_k * on_wall(front, jump)
                errors.append(operator.apply(layer))
        found.append(np.stack(errors, axis=-1) if errors else np.zeros((*shift.displacement_px.shape, 0)))
    return found


def _jumps(wall: WallName, grid: VertexGrid) -> list[Float[np.ndarray, "nx ny nz"]]:
    """The same all over the wall, and rising with the height; floor and ceiling have one height."""
    rising = np.broadcast_to(np.linspace(-1.0, 1.0, grid.shape[2]), grid.shape)
    return [np.ones(grid.shape), rising][: 1 if wall in ("z_min", "z_max") else 2]


def _opposite(wall: WallName) -> WallName:
    return WALLS[WALLS.index(wall) ^ 1]
