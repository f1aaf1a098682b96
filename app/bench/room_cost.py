"""airlens bench room-cost: what one march of a room costs, and what the derivatives of its parameters cost.

A march runs from air at rest with the plane's profile until the standard preset would stop it; another starts
from a coarse room that has settled, as a reconstruction's does. Beside both is the error of u that they leave.
Derivatives are restarts of the settled room with one parameter moved each, as the fit makes them; with two
threads they run beside each other. Memory is the process', after the march from rest and after the one from a
coarse room: one grid a call for its own.
"""

import json
import resource
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from app.volume.file import RoomVolume, read_volume
from app.volume.measurement import known_planes
from app.volume.scene import RigOptions, room_scene
from app.volume.score import score_solution
from core.estimate.forward_runs import ForwardRun, RoomSettings, first_profile_k, march_under, perturbed
from core.estimate.marches import Marches
from core.estimate.prior import Prior, room_prior
from core.problem import Problem
from core.result import Solution
from core.room.forward import Room, carried_over, closure_name, room, room_fields
from core.room.march import MarchSettings, march
from core.room.room_grid import AXES
from core.room.step import Flow

_VERTICES = (64, 64, 64)


def register(bench: typer.Typer) -> None:
    """Add the command."""

    @bench.command("room-cost")
    def room_cost(
        truth: Annotated[Path, typer.Option(help="Room volume (NPZ).")],
        cells: Annotated[list[int] | None, typer.Option(help="Grids; 32, 48 and 64 by default.")] = None,
        jacobian: Annotated[
            bool, typer.Option(help="Also six derivatives, on one thread and on two.")
        ] = False,
        as_json: Annotated[bool, typer.Option("--json")] = False,
    ) -> None:
        """Processor seconds, memory and derivatives of a march to the steady state."""
        volume = read_volume(truth)
        for n in cells or [32, 48, 64]:
            row = cost_row(volume, n, jacobian=jacobian)
            typer.echo(json.dumps(row) if as_json else _sentence(row))


def cost_row(volume: RoomVolume, cells: int, *, jacobian: bool) -> dict[str, float | str]:
    """One grid: compile and march times apart, the error that was left, the process' largest memory."""
    problem = _problem(volume)
    closure = closure_name(problem.scene)
    settings = RoomSettings()
    where = room(problem.scene, cells, closure)
    prior = room_prior(problem, where.layout)
    start = where.at_rest(where.model(prior.mean), first_profile_k(problem, where))
    compile_s = _compiled(where, prior, start)
    began_s = time.process_time()
    base = march_under(where, prior.mean, start, settings.settle_s, _VERTICES, Marches())
    run_s = time.process_time() - began_s
    row: dict[str, float | str] = {
        "cells": "x".join(str(where.grid.cells[a]) for a in AXES),
        "compile_s": compile_s,
        "run_cpu_s": run_s,
        "model_s": base.flow.model_s,
        "steps": float(base.flow.steps),
        "left_change": base.flow.change,
        "outcome": base.flow.outcome.name,
        "u_rel": _error(base, volume),
        "memory_mb": _memory_mb(),
    }
    row |= _from_coarse(problem, where, prior, settings, volume)
    row["memory_with_coarse_mb"] = _memory_mb()
    return row | (_derivatives(where, prior, base, settings, run_s) if jacobian else {})


def _from_coarse(
    problem: Problem, where: Room, prior: Prior, settings: RoomSettings, volume: RoomVolume
) -> dict[str, float]:
    """The same room from a coarse one that has settled: both marches' cost, and the error."""
    coarse = room(problem.scene, settings.coarse_cells, where.closure)
    start = coarse.at_rest(coarse.model(prior.mean), first_profile_k(problem, coarse))
    _compiled(coarse, prior, start)
    began_s = time.process_time()
    start_run = march_under(coarse, prior.mean, start, settings.settle_s, _VERTICES, Marches())
    flow = carried_over(start_run.flow.last, coarse.grid, where.grid)
    base = march_under(where, prior.mean, flow, settings.refine_s, _VERTICES, Marches())
    return {"from_coarse_cpu_s": time.process_time() - began_s, "from_coarse_u_rel": _error(base, volume)}


def _memory_mb() -> float:
    """The process' largest so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _compiled(where: Room, prior: Prior, start: Flow) -> float:
    """Processor seconds of a march of three windows: it compiles all that a longer one needs."""
    began_s = time.process_time()
    model = where.model(prior.mean)
    done = march(start, model, MarchSettings(longest_s=3.0, window_s=1.0, settle_s=0.5))
    room_fields(done.mean, model, where.layout, _VERTICES)
    return time.process_time() - began_s


def _error(found: ForwardRun, volume: RoomVolume) -> float:
    """u's error over its rms."""
    fields, axes = found.fields, (volume.x_m, volume.y_m, volume.z_m)
    x, y, z = (np.linspace(axis[0], axis[-1], n) for axis, n in zip(axes, _VERTICES, strict=True))
    there = Solution(x, y, z, volume.ambient_k + fields.excess_k, fields.pressure_m2_s2, fields.velocity_m_s)
    return float(score_solution(there, volume)["u"]["rel"])


def _derivatives(
    where: Room, prior: Prior, base: ForwardRun, settings: RoomSettings, run_s: float
) -> dict[str, float]:
    """Cost of the prior's derivatives scaled to six, over one run, and the gain of a second thread."""
    vector, spread = np.zeros(len(prior.active())), np.ones(len(prior.active()))
    share = 7.0 / (len(vector) + 1)
    found = {}
    for threads in (1, 2):
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        each = replace(settings, threads=threads)
        perturbed(where, prior, vector, spread, base, each, _VERTICES, Marches())
        found[threads] = (time.perf_counter() - wall_s, time.process_time() - cpu_s)
    return {
        "six_derivatives_over_run": share * found[1][1] / run_s,
        "gain_of_second_thread": found[1][0] / found[2][0],
    }


def _problem(volume: RoomVolume) -> Problem:
    scene = room_scene(volume, RigOptions(), "surveyed")
    return Problem(scene, (), known_planes(volume, scene))


def _sentence(row: dict[str, float | str]) -> str:
    text = (
        f"{row['cells']}: {row['run_cpu_s']:.1f} CPU s for {row['model_s']:.0f} s of air in {row['steps']:.0f} "
        f"steps ({row['outcome']}, change {row['left_change']:.3f}), u {row['u_rel']:.3f}; from a coarse room, "
        f"its own march counted, {row['from_coarse_cpu_s']:.1f} CPU s, u {row['from_coarse_u_rel']:.3f}; "
        f"compiled in {row['compile_s']:.1f} s; {row['memory_mb']:.0f} MB, "
        f"{row['memory_with_coarse_mb']:.0f} MB with the coarse room"
    )
    if "gain_of_second_thread" in row:
        text += (
            f"; six derivatives {row['six_derivatives_over_run']:.1f} times a run, a second thread "
            f"{row['gain_of_second_thread']:.2f} times faster"
        )
    return text
