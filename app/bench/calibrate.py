"""`airlens bench calibrate`: how fast this machine is, once; `airlens plan` predicts with it.

Each preset runs twice, small and larger, in a process of its own; two points make the straight line of
its cost model (`core.plan.cost`). Kept in the user's cache folder.
"""

import json
import os
import platform
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from app.bench.parts.isolated import alone
from app.plan.compiling import compiling
from app.plan.machine import Machine, keep_machine, machine_path
from app.simulate.rehearsal import SAMPLE_ROOM
from core.plan.speed import Speed, Work
from core.result import Solution


@dataclass(frozen=True)
class Trial:
    """One run: which preset at which size."""

    preset: str
    size: int


@dataclass(frozen=True)
class Cost:
    """What a trial took, without compiling."""

    work: Work
    solver_s: float
    memory_mb: float


TRIALS = {
    "draft": (Trial("draft", 48), Trial("draft", 96)),
    "standard": (Trial("standard", 24), Trial("standard", 36)),
    "grid": (Trial("grid", 16), Trial("grid", 32)),
    "paper": (Trial("paper", 1), Trial("paper", 2)),
}


def register(bench: typer.Typer) -> None:
    """Add `calibrate`."""
    bench.command("calibrate")(calibrate)


def calibrate(
    out: Annotated[Path | None, typer.Option(help="Where to keep the figures; the cache folder.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON line a trial.")] = False,
) -> None:
    """Measure this machine once, a few minutes, so that plans predict time and memory."""
    speeds: dict[str, Speed] = {}
    for preset, trials in TRIALS.items():
        costs = [cost_of(trial) for trial in trials]
        for trial, cost in zip(trials, costs, strict=True):
            line = {"preset": preset, "size": trial.size, "work": cost.work.loops, "solver_s": cost.solver_s}
            line["memory_mb"] = cost.memory_mb
            typer.echo(json.dumps(line) if as_json else _sentence(trial, cost))
        speeds[preset] = line_through(*costs)
    # The same march on a finer grid.
    speeds["reference"] = speeds["standard"]
    path = out or machine_path()
    machine = Machine(
        name=f"{platform.machine()}, {os.cpu_count()} cores",
        measured=datetime.now(UTC).date().isoformat(),
        speeds=speeds,
    )
    keep_machine(machine, path)
    if not as_json:
        typer.echo(f"Kept in {path}.")


def line_through(small: Cost, large: Cost) -> Speed:
    """Both straight lines; noise that would make a rate negative makes it zero."""
    s_per_work = max((large.solver_s - small.solver_s) / (large.work.loops - small.work.loops), 0.0)
    growth = large.work.size - small.work.size
    mb_per_size = max((large.memory_mb - small.memory_mb) / growth, 0.0) if growth else 0.0
    return Speed(
        fixed_s=max(small.solver_s - s_per_work * small.work.loops, 0.0),
        s_per_work=s_per_work,
        fixed_mb=max(small.memory_mb - mb_per_size * small.work.size, 0.0),
        mb_per_size=mb_per_size,
    )


def cost_of(trial: Trial) -> Cost:
    """One trial in a fresh process."""
    (work, solver_s), memory_mb = alone(run, trial)
    return Cost(work, solver_s, memory_mb)


def run(trial: Trial) -> tuple[Work, float]:
    """Solve the packaged room; the work is counted as the plan will count it. What is compiled is left out."""
    work, solve = PREPARE[trial.preset](trial.size)
    before = compiling().so_far
    solver_s = solve().solver_s
    return work, max(0.0, solver_s - compiling().so_far.since(before).seconds)


Prepared = tuple[Work, Callable[[], Solution]]


def _problem(grid: int):
    from app.reconstruct.problem import with_scene
    from app.volume.file import read_volume
    from app.volume.measurement import synthetic_problem
    from app.volume.scene import RigOptions

    options = RigOptions(camera_px=(1024, 768))
    made = synthetic_problem(read_volume(SAMPLE_ROOM), options, "surveyed", window_px=16, seed=0)
    scene = replace(made.scene, solve=replace(made.scene.solve, grid=grid))
    return with_scene(made, scene)


def _draft(cells: int) -> Prepared:
    from core.plan.cost import draft_work
    from core.solve.draft.draft import solve_draft

    problem = _problem(cells)
    return draft_work(problem, len(problem.shifts[0].centres_px)), lambda: solve_draft(problem)


def _standard(cells: int) -> Prepared:
    from core.estimate.forward_runs import RoomSettings
    from core.plan.cost import room_work
    from core.plan.expected import expected_flow
    from core.solve.room import solve_room

    problem = _problem(32)
    settings = RoomSettings(cells=cells, coarse_cells=cells * 2 // 3)
    work = room_work(problem, expected_flow(problem), settings)
    if work is None:
        raise RuntimeError("The packaged room states nothing that drives its air.")
    return work, lambda: solve_room(problem, settings)


def _grid(cells: int) -> Prepared:
    from core.plan.cost import grid_work
    from core.solve.grid.grid import solve_grid
    from core.solve.recipes import grid_settings

    problem = _problem(cells)
    return grid_work(problem), lambda: solve_grid(problem, grid_settings(problem))


def _paper(steps: int) -> Prepared:
    from core.solve.network.mlp import solve_mlp
    from core.solve.recipes import paper_settings

    problem = _problem(32)
    return Work(float(steps), 1.0), lambda: solve_mlp(problem, paper_settings(problem, steps))


PREPARE: dict[str, Callable[[int], Prepared]] = {
    "draft": _draft,
    "standard": _standard,
    "grid": _grid,
    "paper": _paper,
}


def _sentence(trial: Trial, cost: Cost) -> str:
    return f"{trial.preset} at {trial.size}: {cost.solver_s:.1f} s for {cost.work.loops:.3g}, {cost.memory_mb:.0f} MB"
