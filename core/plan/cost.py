"""The cost of each preset before it runs: work counted from the scene, speed from this machine.

    seconds = fixed + rate * work,      memory = fixed + rate * size

Work is a count of the dominant loop: windows and vertices of the normal equations (draft), cell-steps of
every march (standard, reference), cells (grid), iterations (paper). `airlens bench calibrate` measures both lines of
each preset on a machine.
"""

from dataclasses import dataclass

import numpy as np

from core.estimate.forward_runs import RoomSettings
from core.estimate.prior import room_prior
from core.estimate.schedule import fit_work
from core.plan.expected import ExpectedFlow
from core.problem import Problem
from core.room.forward import closure_name, room
from core.setting import setting
from core.solve.draft.draft import draft_grid
from core.solve.recipes import PAPER_STEPS

# Iterations of `draft` without a plane over those with one: 55 over 35, median of six rooms.
_FREE_PROFILE = 1.5


@dataclass(frozen=True)
class Work:
    """The work of a preset and the size of its arrays, in units of its own loop."""

    loops: float
    size: float


@setting
class Speed:
    """One preset on one machine: seconds and megabytes as straight lines in its work and its size."""

    fixed_s: float
    s_per_work: float
    fixed_mb: float
    mb_per_size: float

    def seconds(self, work: Work) -> float:
        """Solver time."""
        return self.fixed_s + self.s_per_work * work.loops

    def megabytes(self, work: Work) -> float:
        """Peak memory."""
        return self.fixed_mb + self.mb_per_size * work.size


def draft_work(problem: Problem, windows: int) -> Work:
    """Conjugate gradients: products of windows with slabs, and more iterations where the profile is free."""
    nx, ny, nz = draft_grid(problem.scene).shape
    iterations = 1.0 if problem.planes else _FREE_PROFILE
    return Work(loops=iterations * windows * ny * (nx + nz), size=float(windows * ny + nx * ny * nz))


def room_work(problem: Problem, flow: ExpectedFlow, settings: RoomSettings) -> Work | None:
    """Cell-steps of every march; None where nothing drives a flow."""
    if flow.step_s is None or flow.cell_m is None:
        return None
    scene = problem.scene
    coarse = room(scene, settings.coarse_cells, closure_name(scene))
    fine = room(scene, settings.cells, closure_name(scene))
    prior = room_prior(problem, coarse.layout)
    steps = flow.turnover_ratio / flow.step_s * flow.cell_m
    return Work(steps * fit_work(coarse, fine, prior, settings), float(np.prod(fine.grid.cells)))


def grid_work(problem: Problem) -> Work:
    """Cells of the finest level."""
    chosen = problem.scene.solve.grid
    cells = float((32 if chosen == "auto" else chosen) ** 3)
    return Work(cells, cells)


def paper_work() -> Work:
    """Iterations of the published recipe."""
    return Work(float(PAPER_STEPS), 1.0)
