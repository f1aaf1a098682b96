"""The cost of each preset before it runs: work counted from the scene, speed from this machine.

    seconds = fixed + rate * work,      memory = fixed + rate * size

Work is a count of the dominant loop: windows and vertices of the normal equations (draft), cell-steps of
every march (standard, reference), cells (grid), iterations (paper). `airlens bench calibrate` measures both lines of
each preset on a machine, compiling left out.
"""

import numpy as np

from core.displacement import resolve_window_px, window_centres
from core.estimate.forward_runs import RoomSettings
from core.estimate.prior import room_prior
from core.estimate.schedule import fit_work
from core.plan.expected import ExpectedFlow
from core.plan.speed import Work
from core.problem import Problem
from core.rays.visibility import sees_wall
from core.room.forward import closure_name, room
from core.scene import Scene
from core.solve.draft.draft import draft_grid
from core.solve.recipes import PAPER_STEPS

# Iterations of `draft` without a plane over those with one: 55 over 35, median of six rooms.
_FREE_PROFILE = 1.5


def windows_seen(scene: Scene) -> int:
    """How many windows of all views see the wall, whole: as many as are measured."""
    return sum(_windows_of(scene, index) for index in range(len(scene.views)))


def _windows_of(scene: Scene, index: int) -> int:
    view = scene.views[index]
    window_px = resolve_window_px(scene, view)
    centres = window_centres((view.camera.height_px, view.camera.width_px), window_px)
    return int(sees_wall(scene, index, centres, margin_px=float(window_px)).sum())


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
