"""Named ways to solve with the grid and the network; what each cost and bought is in README."""

from collections.abc import Callable
from typing import Any

import numpy as np

from core.mlp import MlpSettings
from core.problem import Problem
from core.result import Solution
from core.solve.checkpoint import CheckpointStore
from core.solve.grid.grid import GridSettings, solve_grid
from core.solve.loop import LoopSettings
from core.solve.network.mlp import MlpSolveSettings, solve_mlp
from core.solve.regime import Regime, Weights

OnEvent = Callable[[dict[str, Any]], object]
PAPER_STEPS = 80_000


def regime_for(problem: Problem) -> Regime:
    """All three losses where there are images, without the image loss where there are none."""
    return "bos+pde+boundary" if problem.shifts or problem.images else "pde+boundary"


def solve_grid_recipe(
    problem: Problem,
    *,
    on_event: OnEvent | None = None,
    store: CheckpointStore | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Solution:
    """All losses on the grid; `scene.solve.grid` cells an axis, 32 by default."""
    chosen = problem.scene.solve.grid
    cells = 32 if chosen == "auto" else chosen
    coarsest = next((n for n in (cells // 4, cells // 2) if n >= 16 and cells % n == 0), cells)
    settings = GridSettings(regime=regime_for(problem), cells=cells, coarsest=coarsest)
    watch = _told(on_event, problem)
    return solve_grid(problem, settings, on_event=on_event, store=store, should_stop=should_stop, watch=watch)


def solve_paper(
    problem: Problem,
    *,
    on_event: OnEvent | None = None,
    store: CheckpointStore | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Solution:
    """The paper's recipe: AdaBelief, 80,000 iterations, batches of 8192, 5000 and 4096, 64 vertices.

    Rays go through the network; there are its three losses and no belief about smoothness.
    """
    settings = paper_settings(problem, PAPER_STEPS)
    watch = _told(on_event, problem)
    return solve_mlp(problem, settings, on_event=on_event, store=store, should_stop=should_stop, watch=watch)


def paper_settings(problem: Problem, steps: int) -> MlpSolveSettings:
    """The published recipe for `steps` iterations."""
    return MlpSolveSettings(
        regime=regime_for(problem),
        network=MlpSettings(hidden_layers=4, width=128),
        loop=LoopSettings(steps=steps, patience=steps),
        weights=Weights(smoothness=0.0),
        rays="network",
    )


def _told(on_event: OnEvent | None, problem: Problem) -> Callable[[Solution], object] | None:
    """What tells the temperature's middle plane [x, z], for somebody to watch it grow."""
    if on_event is None:
        return None
    ambient_k = problem.scene.air.ambient_temperature_k

    def tell(solution: Solution) -> None:
        plane = solution.temperature_k[:, solution.temperature_k.shape[1] // 2] - ambient_k
        on_event({"kind": "plane", "excess_plane_k": np.asarray(plane, np.float32)})

    return tell
