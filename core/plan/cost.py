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
from core.plan.expected import ExpectedFlow
from core.problem import Problem
from core.room.forward import closure_name, room
from core.setting import setting
from core.solve.draft.draft import draft_grid
from core.solve.recipes import PAPER_STEPS

# Iterations of `draft` without a plane over those with one: 55 over 35, median of six rooms.
_FREE_PROFILE = 1.5
# Usual number of rounds of the fit on the fine grid, with stated and with unknown walls.
_STATED_ROUNDS, _UNKNOWN_ROUNDS = 3, 6


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
    restarts = (1 + len(prior.active())) * settings.restart_s
    # Unknown walls move far: Jacobians are computed anew, and the fit takes more rounds.
    far = bool(prior.unknown_walls())
    rounds = min(settings.rounds, _UNKNOWN_ROUNDS if far else _STATED_ROUNDS)
    # Beside the Jacobian: one round on the coarse grid, and the run under another closure.
    coarse_s = settings.settle_s + (1 + settings.renewals * far) * restarts + 2 * settings.restart_s
    # The room as stated, each round, and two marches that hold the level of T.
    fine_s = (2 + rounds) * settings.refine_s + settings.final_s
    steps = flow.turnover_ratio / flow.step_s * flow.cell_m
    loops = 0.0
    for place, seconds in ((coarse, coarse_s), (fine, fine_s)):
        cells = float(np.prod(place.grid.cells))
        loops += cells * seconds * steps / min(place.grid.spacing_m)
    return Work(loops, float(np.prod(fine.grid.cells)))


def grid_work(problem: Problem) -> Work:
    """Cells of the finest level."""
    chosen = problem.scene.solve.grid
    cells = float((32 if chosen == "auto" else chosen) ** 3)
    return Work(cells, cells)


def paper_work() -> Work:
    """Iterations of the published recipe."""
    return Work(float(PAPER_STEPS), 1.0)
