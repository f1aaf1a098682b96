"""`draft` for a problem: choose the grid, build the straight-ray operators, solve for the temperature."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.known_temperature import VertexGrid
from core.problem import Problem
from core.rays.operator import StraightRayOperator, build
from core.result import Solution
from core.scene import Scene
from core.solve.check import check_problem
from core.solve.draft.temperature import solve_temperature
from core.solve.draft.temperature_prior import TemperatureSettings
from core.watch import Watch

_apply = jax.jit(lambda operator, values: operator.apply(values))
_transpose = jax.jit(lambda operator, shift: operator.transpose(shift))


class _OnTheDevice:
    """A `ShiftOperator` for NumPy arrays, in float64: compiled once, the weights passed as arguments.

    Along the view the data say nothing, and conjugate gradients then stall on float32's rounding.
    """

    def __init__(self, operator: StraightRayOperator) -> None:
        with jax.enable_x64(True):
            self._operator = jax.tree.map(_widened, operator)

    def apply(self, values: Float[np.ndarray, "nx ny nz"]) -> Float[np.ndarray, "windows 2"]:
        with jax.enable_x64(True):
            return np.asarray(_apply(self._operator, jnp.asarray(values, jnp.float64)))

    def transpose(self, displacement_px: Float[np.ndarray, "windows 2"]) -> Float[np.ndarray, "nx ny nz"]:
        with jax.enable_x64(True):
            return np.asarray(_transpose(self._operator, jnp.asarray(displacement_px, jnp.float64)))


def _widened(leaf: Array) -> Array:
    return leaf.astype(jnp.float64) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf


def draft_grid(scene: Scene) -> VertexGrid:
    """48 cells along the room's longest side; along the view, where images see nothing, a third as many."""
    size = scene.room.size_m
    longest = 48 if scene.solve.grid == "auto" else scene.solve.grid
    spacing = max(size) / longest
    counts = [int(np.clip(round(s / spacing), 8, longest)) + 1 for s in size]
    counts[1] = max(9, (counts[1] + 2) // 3)
    return VertexGrid(scene.room, (counts[0], counts[1], counts[2]))


def solve_draft(
    problem: Problem, settings: TemperatureSettings = TemperatureSettings(), watch: Watch = Watch()
) -> Solution:
    """Temperature in at most some ten seconds; nothing is kept of one that is stopped.

    Raises SettingError, StoppedError.
    """
    check_problem(problem, "bos+boundary")
    grid = draft_grid(problem.scene)
    operators = tuple(
        _OnTheDevice(build(problem.scene, view, shift.centres_px, grid.shape, float(shift.window_px)))
        for view, shift in enumerate(problem.shifts)
    )
    return solve_temperature(problem, operators, grid, settings, watch)
