"""`grid`: (T, p, u) on a staggered grid, coarse to fine, by Gauss-Newton steps.

Every level adds corrections to the coarser ones, so that CG moves all wavelengths at once. Cost: a few
steps a level, each some tens of CG iterations of two linearised residuals.
"""

import time
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np

from core.grid.multiresolution import MultiGrid, zero_multigrid
from core.grid.staggered import StaggeredGrid
from core.losses import Loss, all_rows
from core.problem import Problem
from core.representation import Unknowns, positions
from core.result import Outcome, Solution
from core.setting import SettingError, setting
from core.solve.check import check_problem
from core.solve.frame import Frame, frame_of, height_profile
from core.solve.gauss_newton import Step, gauss_newton_step
from core.solve.regime import DataModel, Regime, Weights, losses_of
from core.solve.solution import solution_of

OnEvent = Callable[[dict[str, Any]], object]


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


def solve_grid(
    problem: Problem,
    settings: GridSettings,
    *,
    on_event: OnEvent | None = None,
) -> Solution:
    """T, p, u on vertices, `cells` + 1 an axis. Raises SettingError for a problem that cannot be solved."""
    check_problem(problem, settings.regime)
    started = time.perf_counter()
    frame = frame_of(problem)
    unknowns = initial_unknowns(problem, frame, settings)
    history: list[dict[str, float]] = []
    outcome = Outcome.converged
    while True:
        cells = _multigrid(unknowns).finest.cells[0]
        losses = losses_of(
            problem,
            frame,
            settings.regime,
            settings.weights,
            settings.data,
            _cubic(cells + 1),
            wall_points=2 * cells + 1,
        )
        unknowns, outcome = _descend(unknowns, losses, settings, history, started, on_event)
        if cells == settings.cells or outcome in (Outcome.nonfinite, Outcome.time_limit):
            break
        unknowns = Unknowns(_multigrid(unknowns).refined(), unknowns.drift_px, unknowns.log_transport)
    return solution_of(
        unknowns, frame, _cubic(settings.cells + 1), outcome, time.perf_counter() - started, history
    )


def initial_unknowns(problem: Problem, frame: Frame, settings: GridSettings) -> Unknowns:
    """Still air, T and p of the known plane's height profile (ambient without one), on the coarsest grid."""
    grid = StaggeredGrid(frame.lower, frame.upper, _cubic(settings.coarsest))
    multigrid = zero_multigrid(grid)
    spans = frame.vertices(_cubic(settings.coarsest + 1))
    x, y, z = (positions(span) for span in spans)
    state = grid.of_fields((x, y, z), height_profile(problem, frame, spans))
    levels = (*multigrid.levels[:-1], state)
    drift = None
    if settings.data.drift_std_px is not None and problem.shifts:
        drift = jnp.zeros((len(problem.shifts), 4))
    learned = jnp.zeros(2) if problem.scene.flow.transport == "learned" else None
    return Unknowns(MultiGrid(levels, multigrid.grids), drift, learned)


def _cubic(n: int) -> tuple[int, int, int]:
    return n, n, n


def _multigrid(unknowns: Unknowns) -> MultiGrid:
    if not isinstance(unknowns.representation, MultiGrid):
        raise TypeError(f"the grid solver was given {type(unknowns.representation).__name__}")
    return unknowns.representation


def _rows(unknowns: Unknowns, losses: tuple[Loss, ...]):
    return all_rows(losses, unknowns)


def _descend(
    unknowns: Unknowns,
    losses: tuple[Loss, ...],
    settings: GridSettings,
    history: list[dict[str, float]],
    started: float,
    on_event: OnEvent | None,
) -> tuple[Unknowns, Outcome]:
    """Gauss-Newton on one level until a step gains less than `settled`; a bad step is taken back."""
    damping = settings.damping
    for _ in range(settings.steps_a_level):
        step = gauss_newton_step(_rows, unknowns, losses, jnp.float32(damping), settings.cg_iterations, 1e-2)
        before, after = float(step.cost_before), float(step.cost_after)
        if not np.isfinite(before):
            return unknowns, Outcome.nonfinite
        history.append(_record(step, unknowns, started, damping))
        if on_event:
            on_event(history[-1])
        if not after < before:
            damping = max(10 * damping, 1e-6)
            if damping > 1e2:
                return unknowns, Outcome.nonfinite if not np.isfinite(after) else Outcome.converged
            continue
        unknowns, damping = step.unknowns, max(damping / 5, 1e-8)
        if settings.time_limit_s is not None and time.perf_counter() - started > settings.time_limit_s:
            return unknowns, Outcome.time_limit
        if before - after < settings.settled * before:
            return unknowns, Outcome.converged
    return unknowns, Outcome.step_limit


def _record(step: Step, unknowns: Unknowns, started: float, damping: float) -> dict[str, float]:
    return {
        "cells": float(_multigrid(unknowns).finest.cells[0]),
        "loss": 2 * float(step.cost_before),
        "loss_after": 2 * float(step.cost_after),
        "cg_iterations": float(step.cg_iterations),
        "damping": damping,
        "elapsed_s": time.perf_counter() - started,
    }
