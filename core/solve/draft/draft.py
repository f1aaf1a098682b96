"""`draft` for a problem: choose the grid, build the straight-ray operators, solve for the temperature."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.data_error import WALL_MARGIN
from core.known_temperature import VertexGrid
from core.motion import WithoutMotion
from core.problem import Problem
from core.rays.operator import StraightRayOperator, build
from core.rays.visibility import away_from_walls
from core.result import Solution
from core.scene import Scene
from core.solve.check import check_problem
from core.solve.draft.conjugate_gradients import Product
from core.solve.draft.temperature import solve_temperature
from core.solve.draft.temperature_prior import TemperatureSettings
from core.view_frame import looked_along
from core.watch import Watch

_apply = jax.jit(lambda operator, values: operator.apply(values))
_transpose = jax.jit(lambda operator, shift: operator.transpose(shift))


@jax.jit
def _normal(
    operator: StraightRayOperator, weight: Array, still: WithoutMotion | None, values: Array
) -> Array:
    shift = operator.apply(values)
    if still is not None:
        shift = shift - still.out @ jnp.einsum("wap,wa->p", still.along, shift)
    shift = jnp.einsum("wab,wb->wa", weight, shift)
    if still is not None:
        shift = shift - still.along @ jnp.einsum("wap,wa->p", still.out, shift)
    return operator.transpose(shift)


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

    def normal(self, weight: Float[np.ndarray, "windows 2 2"], still: WithoutMotion | None = None) -> Product:
        """One program for all three products: an iteration waits for it once."""
        with jax.enable_x64(True):
            fixed = (self._operator, jnp.asarray(weight), jax.tree.map(jnp.asarray, still))

        def product(values: Float[np.ndarray, "nx ny nz"]) -> Float[np.ndarray, "nx ny nz"]:
            with jax.enable_x64(True):
                return np.asarray(_normal(*fixed, jnp.asarray(values, jnp.float64)))

        return product


def _widened(leaf: Array) -> Array:
    return leaf.astype(jnp.float64) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf


def draft_grid(scene: Scene) -> VertexGrid:
    """48 cells along the room's longest side; along an axis that all views look along, a third as many."""
    size = scene.room.size_m
    longest = 48 if scene.solve.grid == "auto" else scene.solve.grid
    spacing = max(size) / longest
    counts = [int(np.clip(round(s / spacing), 8, longest)) + 1 for s in size]
    unseen = looked_along(scene)
    if len(unseen) == 1:
        counts[unseen[0]] = max(9, (counts[unseen[0]] + 2) // 3)
    return VertexGrid(scene.room, (counts[0], counts[1], counts[2]))


def solve_draft(
    problem: Problem, settings: TemperatureSettings = TemperatureSettings(), watch: Watch = Watch()
) -> Solution:
    """Temperature in at most some ten seconds; nothing is kept of one that is stopped.

    Raises SettingError, StoppedError.
    """
    check_problem(problem, "bos+boundary")
    problem = _past_layers(problem)
    grid = draft_grid(problem.scene)
    operators = tuple(
        _OnTheDevice(build(problem.scene, view, shift.centres_px, grid.shape, float(shift.window_px)))
        for view, shift in enumerate(problem.shifts)
    )
    return solve_temperature(problem, operators, grid, settings, watch)


def _past_layers(problem: Problem) -> Problem:
    """The problem without windows beside walls, where views look along several axes.

    A wall's thermal layer is thinner than a cell. A view along the wall sees it in those windows, and where another
    view looks at the wall nothing else can take it up: it would be spread over the room.
    """
    if len(looked_along(problem.scene)) < 2:
        return problem
    shifts = tuple(
        shift.at(away_from_walls(problem.scene, view, shift.centres_px, WALL_MARGIN))
        for view, shift in enumerate(problem.shifts)
    )
    return Problem(problem.scene, shifts, problem.planes, problem.sensors, problem.images)
