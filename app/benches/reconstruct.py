"""`airlens bench reconstruct`: temperature error against solver seconds, for the grid and the network.

Both solve the same problem in one process, one after the other; CPU seconds, compilation apart.
"""

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from app.bench_options import AsJson, Batch, Information, Layers, Out, Volume, Width, network
from app.durable import durable_path
from app.room_scene import RigOptions
from app.score import score_solution
from app.synthetic_problem import synthetic_problem
from app.truth import RoomVolume, read_volume
from core.problem import Problem
from core.result import Solution
from core.solve.grid import GridSettings, solve_grid
from core.solve.loop import LoopSettings
from core.solve.mlp import MlpSolveSettings, solve_mlp
from core.solve.regime import Regime


def register(bench: typer.Typer) -> None:
    """Add `reconstruct`."""
    bench.command("reconstruct")(reconstruct)


def reconstruct(
    volume: Volume,
    out: Out = Path("bench"),
    information: Information = "paper",
    light: Annotated[str, typer.Option(help="texture or projector.")] = "texture",
    regime: Annotated[str, typer.Option(help="A list of losses, joined by +.")] = "bos+pde+boundary",
    cells: Annotated[int, typer.Option(help="Cells an axis of the grid.")] = 32,
    network_s: Annotated[float, typer.Option(help="Seconds for the network.")] = 120.0,
    layers: Layers = 4,
    width: Width = 128,
    batch: Batch = 8192,
    as_json: AsJson = False,
) -> None:
    """Error against time of `grid` and `mlp` on one volume, in one run."""
    truth = read_volume(volume)
    options = RigOptions(light=light)  # type: ignore[arg-type]
    problem = synthetic_problem(truth, options, information, window_px=32, seed=0)  # type: ignore[arg-type]
    lines = run_grid(problem, truth, regime, cells)  # type: ignore[arg-type]
    loop = LoopSettings(record_every=20, time_limit_s=network_s)
    lines += run_network(problem, truth, network(regime, layers, width, batch, loop))
    _write(out, lines, truth, information, light)
    for line in [*lines, _ratio(lines)]:
        typer.echo(json.dumps(line) if as_json else "  ".join(f"{k} {v}" for k, v in line.items()))


def run_grid(problem: Problem, truth: RoomVolume, regime: Regime, cells: int) -> list[dict[str, Any]]:
    """Twice: the first run compiles."""
    settings = GridSettings(regime=regime, cells=cells, coarsest=min(cells, 32))
    began = time.process_time()
    solve_grid(problem, settings)
    with_compilation_s = time.process_time() - began
    began = time.process_time()
    found = solve_grid(problem, settings)
    cpu_s = time.process_time() - began
    point = {"method": "grid", "cells": cells, "compile_s": round(with_compilation_s - cpu_s, 2)}
    return [{**point, "cpu_s": round(cpu_s, 2), **errors(found, truth), "outcome": found.outcome.name}]


def run_network(problem: Problem, truth: RoomVolume, settings: MlpSolveSettings) -> list[dict[str, Any]]:
    """One point a record; the time of scoring is left out."""
    lines: list[dict[str, Any]] = []
    clock = {"start": 0.0}

    def tell(event: dict[str, Any]) -> None:
        if event["kind"] == "start":
            clock["start"] = time.process_time()
            clock["compile"] = event["compile_s"]

    def watch(found: Solution) -> None:
        now = time.process_time()
        point = {"method": "mlp", "cpu_s": round(now - clock["start"], 2), **errors(found, truth)}
        lines.append({**point, "compile_s": round(clock["compile"], 2)})
        clock["start"] += time.process_time() - now

    found = solve_mlp(problem, settings, on_event=tell, watch=watch)
    lines.append({"method": "mlp best", **errors(found, truth), "outcome": found.outcome.name})
    return lines


def errors(found: Solution, truth: RoomVolume) -> dict[str, Any]:
    """The yardstick's main figures: K, and relative for u and p."""
    scores = score_solution(found, truth)
    named = {
        "T_K": scores["T"]["rms_K"],
        "T_departure": scores["T"]["departure_of_departures"],
        "p": scores["p"]["rel"],
        "p_departure": scores["p"]["rel_departure"],
        "u": scores["u"]["rel"],
    }
    return {name: None if value is None else round(float(value), 4) for name, value in named.items()}


def trivial(found: Solution, truth: RoomVolume) -> dict[str, Any]:
    """What costs nothing: the inlet plane carried along x (T, p) and still air (u)."""
    scores = score_solution(found, truth)
    named = {
        "trivial_T_K": scores["T"]["trivial"]["inlet_plane"],
        "trivial_p": scores["p"]["trivial"]["inlet_plane"],
        "trivial_u": scores["u"]["trivial"]["zero"],
    }
    return {name: round(float(value), 4) for name, value in named.items()}


def _ratio(lines: list[dict[str, Any]]) -> dict[str, Any]:
    """How much sooner the grid has the error that the network ends with."""
    grid = next(line for line in lines if line["method"] == "grid")
    curve = [line for line in lines if line["method"] == "mlp"]
    reached = [line["cpu_s"] for line in curve if line["T_K"] <= grid["T_K"]]
    spent = max((line["cpu_s"] for line in curve), default=0.0)
    return {
        "grid_T_K": grid["T_K"],
        "grid_cpu_s": grid["cpu_s"],
        "mlp_reached": bool(reached),
        "mlp_cpu_s": reached[0] if reached else spent,
        "ratio" if reached else "ratio_at_least": round(
            (reached[0] if reached else spent) / grid["cpu_s"], 1
        ),
    }


def _write(out: Path, lines: list[dict[str, Any]], truth: RoomVolume, information: str, light: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with durable_path(out / "lines.jsonl") as path:
        path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    figure, axes = pyplot.subplots(figsize=(6, 4), constrained_layout=True)
    curve = [line for line in lines if line["method"] == "mlp"]
    axes.plot([line["cpu_s"] for line in curve], [line["T_K"] for line in curve], label="mlp")
    grid = [line for line in lines if line["method"] == "grid"]
    axes.plot([line["cpu_s"] for line in grid], [line["T_K"] for line in grid], "o", label="grid")
    axes.set(xscale="log", yscale="log", xlabel="solver CPU seconds", ylabel="T rms error [K]")
    axes.set_title(f"{information} information, {light}, ambient {truth.ambient_k:.2f} K")
    axes.legend()
    with durable_path(out / "curves.png") as path:
        figure.savefig(path, dpi=120)
    pyplot.close(figure)
