"""Settings of the grid and the network for a problem; what each cost and bought is in README."""

from core.mlp import MlpSettings
from core.problem import Problem
from core.solve.grid.grid import GridSettings
from core.solve.loop import LoopSettings
from core.solve.network.mlp import MlpSolveSettings
from core.solve.regime import Regime, Weights

PAPER_STEPS = 80_000


def regime_for(problem: Problem) -> Regime:
    """All three losses where there are images, without the image loss where there are none."""
    return "bos+pde+boundary" if problem.shifts or problem.images else "pde+boundary"


def grid_settings(problem: Problem) -> GridSettings:
    """All losses on the grid; `scene.solve.grid` cells an axis, 32 by default."""
    chosen = problem.scene.solve.grid
    cells = 32 if chosen == "auto" else chosen
    coarsest = next((n for n in (cells // 4, cells // 2) if n >= 16 and cells % n == 0), cells)
    return GridSettings(regime=regime_for(problem), cells=cells, coarsest=coarsest)


def paper_settings(problem: Problem, steps: int = PAPER_STEPS) -> MlpSolveSettings:
    """The published recipe: AdaBelief, batches of 8192, 5000 and 4096, 64 vertices.

    Rays go through the network; there are its three losses and no prior for smoothness.
    """
    return MlpSolveSettings(
        regime=regime_for(problem),
        network=MlpSettings(hidden_layers=4, width=128),
        loop=LoopSettings(steps=steps, patience=steps),
        weights=Weights(smoothness=0.0),
        rays="network",
    )
