"""`airlens bench draft`: the temperature alone, for each light at each level of information."""

import json
import time
from pathlib import Path
from typing import Any

import typer

from app.bench_options import AsJson, Out, Volume
from app.durable import durable_path
from app.room_scene import Information, RigOptions
from app.score import score_solution
from app.synthetic_problem import synthetic_problem
from app.truth import read_volume
from core.solve.check import check_problem
from core.solve.draft import solve_draft

# The default rig at each level of information; the projector where the plane is known, far away as in the
# paper and as near as a room allows.
CASES: tuple[tuple[str, RigOptions, Information], ...] = (
    ("texture", RigOptions(), "paper"),
    ("texture", RigOptions(), "operator"),
    ("texture", RigOptions(), "surveyed"),
    ("projector, 30.5 m, 1 m aside", RigOptions(light="projector"), "paper"),
    (
        "projector, 4 m, 1 m aside and up",
        RigOptions(light="projector", stand_off_m=4.0, baseline_m=(1.0, 1.0)),
        "paper",
    ),
)


def register(bench: typer.Typer) -> None:
    """Add `draft`."""
    bench.command("draft")(draft)


def draft(
    volume: Volume,
    out: Out = Path("bench"),
    as_json: AsJson = False,
) -> None:
    """T beside the trivial answer, with a printed and with a projected pattern."""
    truth = read_volume(volume)
    lines: list[dict[str, Any]] = []
    for name, options, information in CASES:
        problem = synthetic_problem(truth, options, information, window_px=32, seed=0)
        check_problem(problem, "bos+boundary")
        began = time.process_time()
        found = solve_draft(problem)
        cpu_s = time.process_time() - began
        scores = score_solution(found, truth)["T"]
        line = {
            "rig": name,
            "information": information,
            "T_K": round(scores["rms_K"], 4),
            "T_departure": round(scores["departure_of_departures"], 4),
            "inlet_plane_K": round(scores["trivial"]["inlet_plane"], 4),
            "y_mean_K": round(scores["trivial"]["y_mean"], 4),
            "solver_s": round(found.solver_s, 2),
            "cpu_s": round(cpu_s, 2),
            "outcome": found.outcome.name,
        }
        lines.append(line)
        typer.echo(json.dumps(line) if as_json else "  ".join(f"{k} {v}" for k, v in line.items()))
    with durable_path(out / "draft.jsonl") as path:
        path.write_text("".join(json.dumps(line) + "\n" for line in lines))
