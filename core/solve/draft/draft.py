"""`draft` for a problem: choose the grid, build the straight-ray operators, solve for the temperature."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from core.known_temperature import VertexGrid
from core.problem import Problem
from core.rays.matrix import as_matrix
from core.rays.operator import build
from core.result import Solution
from core.scene import Scene
from core.solve.check import check_problem
from core.solve.draft.conjugate_gradients import Volume
from core.solve.draft.temperature import solve_temperature
from core.solve.draft.temperature_prior import TemperatureSettings, thinned
from core.view_frame import looked_along
from core.watch import Watch

# The operator of a view, for windows at these centres.
RaysOf = Callable[[int, Float[np.ndarray, "windows 2"]], "RayMatrix"]


class RayMatrix:
    """A `ShiftOperator` that is a sparse matrix: the rays of a view through the grid, for NumPy arrays in float64.

    Along the view the data say nothing, and conjugate gradients would stall on float32's rounding.
    """

    def __init__(self, matrix: sparse.csr_array, shape: tuple[int, int, int]) -> None:
        self._matrix, self._back, self._shape = matrix, sparse.csr_array(matrix.T.tocsr()), shape

    @classmethod
    def of(
        cls,
        scene: Scene,
        view: int,
        centres_px: Float[np.ndarray, "windows 2"],
        grid: VertexGrid,
        window_px: int,
    ) -> "RayMatrix":
        """Of windows of a view. Raises SettingError for none."""
        return cls(as_matrix(build(scene, view, centres_px, grid.shape, float(window_px))), grid.shape)

    def at(self, chosen: Int[np.ndarray, " some"]) -> "RayMatrix":
        """Of some of the windows, by their numbers."""
        return RayMatrix(self._matrix[np.stack([2 * chosen, 2 * chosen + 1], axis=1).ravel()], self._shape)

    def apply(self, values: Volume) -> Float[np.ndarray, "windows 2"]:
        """Displacement [px] of every window."""
        return (self._matrix @ values.ravel()).reshape(-1, 2)

    def transpose(self, displacement_px: Float[np.ndarray, "windows 2"]) -> Volume:
        """The transposed map."""
        return (self._back @ displacement_px.ravel()).reshape(self._shape)


def draft_grid(scene: Scene) -> VertexGrid:
    """48 cells along the room's longest side; along an axis that all views look along, a third as many."""
    size = scene.room.size_m
    longest = 48 if scene.solve.grid == "auto" else scene.solve.grid
    spacing = max(size) / longest
    counts = [int(np.clip(round(s / spacing), 8, longest)) + 1 for s in size]
    unseen = looked_along(scene)
    if len(unseen) == 1:
        counts[unseen[0]] = thinned(counts[unseen[0]])
    return VertexGrid(scene.room, (counts[0], counts[1], counts[2]))


def solve_draft(
    problem: Problem,
    settings: TemperatureSettings = TemperatureSettings(),
    watch: Watch = Watch(),
    rays: RaysOf | None = None,
) -> Solution:
    """Temperature in at most some ten seconds; nothing is kept of one that is stopped.

    `rays` gives what was built before, for windows of the draft's grid; left out, it is built. Raises SettingError,
    StoppedError.
    """
    check_problem(problem, "bos+boundary")
    grid = draft_grid(problem.scene)
    operators = tuple(
        rays(view, shift.centres_px)
        if rays
        else RayMatrix.of(problem.scene, view, shift.centres_px, grid, shift.window_px)
        for view, shift in enumerate(problem.shifts)
    )
    return solve_temperature(problem, operators, grid, settings, watch)
