"""`grid`: (T, p, u) on a staggered grid, coarse to fine, by Gauss-Newton steps.

Every level adds corrections to the coarser ones, so that CG moves all wavelengths at once. Cost: a few
steps a level, each some tens of CG iterations of two linearised residuals.
"""

import dataclasses
import time
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from core.checkpoint import claim, digest, encode, keep, newest, restore
from core.grid.multiresolution import MultiGrid, zero_multigrid
from core.grid.staggered import StaggeredGrid
from core.losses.physics import Loss, all_rows
from core.losses.representation import Unknowns, positions
from core.motion import MOTIONS
from core.problem import Problem
from core.result import Outcome, Solution
from core.setting import SettingError, setting
from core.solve.check import check_problem
from core.solve.grid.gauss_newton import NewtonStep, column_scale, gauss_newton_step
from core.solve.grid.start import starting_flow
from core.solve.nondimensional import RoomFrame, frame_of
from core.solve.regime import DataModel, Regime, Weights, losses_of, moved, windows_left_out
from core.solve.solution import solution_of
from core.watch import Row, StoppedError, Store, Watch

# The columns' sizes are measured before a level's first two steps: the first sets the air in motion.
_SCALED_AT = (0, 1)


@setting
class GridSettings:
    """`cells` an axis of the finest grid (a power of two times `coarsest`), and how hard each level works."""

    regime: Regime = "bos+pde+boundary"
    cells: int = 32
    coarsest: int = 16
    steps_a_level: int = 6
    cg_iterations: int = 60
    settled: float = 0.02
    damping: float = 1e-6
    weights: Weights = Weights()
    data: DataModel = DataModel()
    time_limit_s: float | None = None

    def __post_init__(self) -> None:
        ratio = self.cells / self.coarsest
        if self.coarsest < 4 or ratio < 1 or 2 ** round(np.log2(ratio)) * self.coarsest != self.cells:
            raise SettingError(
                f"The grid has {self.cells} cells an axis over a coarsest level of {self.coarsest}; expected "
                "cells = coarsest times a power of two, and at least 4 (32 over 8, 96 over 12)."
            )


class GridState(eqx.Module):
    """Everything that the next Gauss-Newton step depends on; the level is that of the unknowns."""

    unknowns: Unknowns
    scale: PyTree
    damping: Float[Array, ""]
    step: Int[Array, ""]
    ended: Bool[Array, ""]


def solve_grid(
    problem: Problem,
    settings: GridSettings,
    watch: Watch = Watch(),
) -> Solution:
    """T, p, u on vertices, `cells` + 1 an axis.

    A run that `watch.store` knows of goes on with the step it was at and ends bitwise as it would have on a CPU.
    A stop is heard within about a second, but not while a level compiles.

    Raises SettingError for a problem that cannot be solved, ForeignCheckpointError, StoppedError.
    """
    check_problem(problem, settings.regime)
    clock = _Clock(settings.time_limit_s, watch.should_stop)
    frame = frame_of(problem)
    keeper = _Keeper(watch.store, digest(_lasting(settings), problem))
    state, history = keeper.resumed(problem, frame, settings)
    while True:
        cells = _multigrid(state.unknowns).finest.cells[0]

        def taken(state: GridState, history: list[Row], cells: int = cells) -> None:
            keeper.save(state, history)
            shape, unknowns, now_s = _cubic(cells + 1), state.unknowns, clock.elapsed_s
            watch.tell(
                history[-1], lambda: solution_of(unknowns, frame, shape, Outcome.step_limit, now_s, ())
            )

        losses = losses_of(
            problem, frame, settings.regime, settings.weights, settings.data, _cubic(cells + 1), 2 * cells + 1
        )
        state, outcome = _descend(state, losses, settings, history, clock, taken)
        if outcome is None:
            keeper.save(state, history, final=True)
            raise StoppedError
        if cells == settings.cells or outcome in (Outcome.nonfinite, Outcome.time_limit):
            break
        # The next level compiles first, and compilation cannot be interrupted.
        keeper.save(state, history, final=True)
        state = _at_start(Unknowns(_multigrid(state.unknowns).refined(), state.unknowns.drift), settings)
    shape = _cubic(settings.cells + 1)
    notes = windows_left_out(problem, settings.regime)
    return solution_of(state.unknowns, frame, shape, outcome, clock.elapsed_s, history, notes)


def initial_unknowns(problem: Problem, frame: RoomFrame, settings: GridSettings) -> Unknowns:
    """Still air in balance, as warm as what is known, on the coarsest grid."""
    grid = StaggeredGrid(frame.lower, frame.upper, _cubic(settings.coarsest))
    multigrid = zero_multigrid(grid)
    spans = frame.vertices(_cubic(settings.coarsest + 1))
    x, y, z = (positions(span) for span in spans)
    state = grid.of_fields((x, y, z), starting_flow(problem, frame, spans, settings.regime))
    levels = (*multigrid.levels[:-1], state)
    drift = jnp.zeros((len(problem.shifts), MOTIONS)) if moved(problem) else None
    return Unknowns(MultiGrid(levels, multigrid.grids), drift)


def _cubic(n: int) -> tuple[int, int, int]:
    return n, n, n


def _multigrid(unknowns: Unknowns) -> MultiGrid:
    if not isinstance(unknowns.representation, MultiGrid):
        raise TypeError(f"the grid solver was given {type(unknowns.representation).__name__}")
    return unknowns.representation


def _rows(unknowns: Unknowns, losses: tuple[Loss, ...]):
    return all_rows(losses, unknowns)


def _descend(
    state: GridState,
    losses: tuple[Loss, ...],
    settings: GridSettings,
    history: list[Row],
    clock: "_Clock",
    taken: Callable[[GridState, list[Row]], None],
) -> tuple[GridState, Outcome | None]:
    """Gauss-Newton on one level until a step gains less than `settled`; a bad step is taken back.

    The outcome is None where a stop was asked for.
    """
    outcome = Outcome.step_limit if int(state.step) else Outcome.converged
    while not bool(state.ended):
        if clock.is_over:
            return state, Outcome.time_limit
        if int(state.step) in _SCALED_AT:
            scale = column_scale(_rows, state.unknowns, losses)
            state = dataclasses.replace(state, scale=scale)
        step = gauss_newton_step(
            _rows, state.unknowns, losses, state.damping, settings.cg_iterations, 1e-2,
            scale=state.scale, should_stop=clock.should_stop,
        )  # fmt: skip
        if step is None:
            return state, None
        if not np.isfinite(float(step.cost_before)):
            return state, Outcome.nonfinite
        history.append(_record(step, state, clock.elapsed_s, settings))
        state, outcome = _judged(state, step, settings)
        taken(state, history)
    return state, outcome


def _judged(state: GridState, step: NewtonStep, settings: GridSettings) -> tuple[GridState, Outcome]:
    """The state after a step, which is taken where it lowers the cost, and how the level would end here."""
    before, after, number = float(step.cost_before), float(step.cost_after), int(state.step) + 1
    if after < before:
        unknowns, damping = step.unknowns, max(float(state.damping) / 5, 1e-8)
        small = before - after < settings.settled * before
        outcome = Outcome.converged if small else Outcome.step_limit
        ended = small or number >= settings.steps_a_level
    else:
        unknowns, damping = state.unknowns, max(10 * float(state.damping), 1e-6)
        hopeless = damping > 1e2
        outcome = Outcome.converged if np.isfinite(after) else Outcome.nonfinite
        ended = hopeless or number >= settings.steps_a_level
        if ended and not hopeless:
            outcome = Outcome.step_limit
    return GridState(
        unknowns, state.scale, jnp.float32(damping), jnp.int32(number), jnp.array(ended)
    ), outcome


def _at_start(unknowns: Unknowns, settings: GridSettings) -> GridState:
    scale = jax.tree.map(lambda a: jnp.ones((), a.dtype), unknowns)
    return GridState(unknowns, scale, jnp.float32(settings.damping), jnp.int32(0), jnp.array(False))


def _record(step: NewtonStep, state: GridState, elapsed_s: float, settings: GridSettings) -> Row:
    cells, number = _multigrid(state.unknowns).finest.cells[0], int(state.step) + 1
    return {
        "doing": "descend on the grid",
        "cells": float(cells),
        "share": _share(cells, number, settings),
        "loss": 2 * float(step.cost_before),
        "loss_after": 2 * float(step.cost_after),
        "cg_iterations": float(step.cg_iterations),
        "damping": float(state.damping),
        "elapsed_s": elapsed_s,
    }


def _share(cells: int, steps: int, settings: GridSettings) -> float:
    """Of the work of all levels, each with all its steps, what is done after so many on the level of `cells`."""
    levels = [settings.coarsest]
    while levels[-1] < settings.cells:
        levels.append(2 * levels[-1])
    before = sum(n**3 for n in levels if n < cells)
    return (before + cells**3 * steps / settings.steps_a_level) / sum(n**3 for n in levels)


def _lasting(settings: GridSettings) -> GridSettings:
    """Without what a resumed run may change."""
    return dataclasses.replace(settings, time_limit_s=None)


class _Clock:
    """The time since the start, its limit, and whether somebody asked to stop."""

    def __init__(self, limit_s: float | None, should_stop: Callable[[], bool]) -> None:
        self._began, self._limit_s, self.should_stop = time.perf_counter(), limit_s, should_stop

    @property
    def elapsed_s(self) -> float:
        return time.perf_counter() - self._began

    @property
    def is_over(self) -> bool:
        return self._limit_s is not None and self.elapsed_s > self._limit_s


class _Keeper:
    """Saves after a step, at a cost of at most 1 % of the time; finds the state to start from."""

    def __init__(self, store: Store | None, configuration: str) -> None:
        self._store, self._configuration = store, configuration
        if store is not None:
            claim(store, configuration)
        self._last, self._cost_s = time.perf_counter(), 0.0

    def resumed(
        self, problem: Problem, frame: RoomFrame, settings: GridSettings
    ) -> tuple[GridState, list[Row]]:
        """The newest checkpoint's state and history, or the start's."""
        state = _at_start(initial_unknowns(problem, frame, settings), settings)
        found = newest(self._store) if self._store is not None else None
        if found is None:
            return state, []
        history = list(found.header["history"])
        cells = int(found.header["shape"].get("cells", settings.coarsest))
        while _multigrid(state.unknowns).finest.cells[0] < cells:
            finer = _multigrid(state.unknowns).refined()
            state = _at_start(Unknowns(finer, state.unknowns.drift), settings)
        return restore(found, state, configuration=self._configuration), history

    def save(self, state: GridState, history: list[Row], *, final: bool = False) -> None:
        """Keep the state, if it is time or the last chance."""
        now = time.perf_counter()
        if self._store is None or not (final or now - self._last >= 100 * self._cost_s):
            return
        content = encode(
            state,
            configuration=self._configuration,
            step=len(history),
            seed=0,
            history=history,
            shape={"cells": _multigrid(state.unknowns).finest.cells[0]},
        )
        keep(self._store, content)
        self._last = time.perf_counter()
        self._cost_s = self._last - now
