"""`airlens bench draft`: the temperature alone, for each light at each level of information."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import typer

from app.bench.parts.options import AsJson, Out, Volume
from app.files.durable import durable_path
from app.volume.file import RoomVolume, read_volume
from app.volume.measurement import synthetic_problem
from app.volume.scene import Information, RigOptions
from app.volume.score import score_solution, values_at
from core.known import leaving_excess_k
from core.metrics import inner, rms
from core.problem import Problem
from core.result import Solution
from core.setting import SettingError
from core.solve.draft.draft import solve_draft

# The default rig at each level of information; the projector far away as in the paper and as near as a room
# allows, with and without the plane.
_FAR = ("projector, 30.5 m, 1 m aside", RigOptions(light="projector"))
_NEAR = (
    "projector, 4 m, 1 m aside and up",
    RigOptions(light="projector", stand_off_m=4.0, baseline_m=(1.0, 1.0)),
)
CASES: tuple[tuple[str, RigOptions, Information], ...] = (
    ("texture", RigOptions(), "paper"),
    ("texture", RigOptions(), "operator"),
    ("texture", RigOptions(), "surveyed"),
    (*_FAR, "paper"),
    (*_FAR, "operator"),
    (*_NEAR, "paper"),
    (*_NEAR, "operator"),
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
        began = time.process_time()
        try:
            found = solve_draft(problem)
        except SettingError as error:
            typer.echo(f"{name}, {information}: {error}", err=True)
            continue
        cpu_s = time.process_time() - began
        scores = score_solution(found, truth)["T"]
        line = {
            "rig": name,
            "information": information,
            "room": volume.stem,
            "T_K": round(scores["rms_K"], 4),
            "T_air_K": round(scores["air"]["rms_K"], 4),
            "T_departure": round(scores["departure_of_departures"], 4),
            "inlet_plane_K": round(scores["trivial"]["inlet_plane"], 4),
            "y_mean_K": round(scores["trivial"]["y_mean"], 4),
            "outlet_K": _outlet_everywhere_k(problem, truth),
            "within_2_std": _within(found, truth),
            "solver_s": round(found.solver_s, 2),
            "cpu_s": round(cpu_s, 2),
            "outcome": found.outcome.name,
        }
        lines.append(line)
        typer.echo(json.dumps(line) if as_json else "  ".join(f"{k} {v}" for k, v in line.items()))
    with durable_path(out / "draft.jsonl") as path:
        path.write_text("".join(json.dumps(line) + "\n" for line in lines))


def _outlet_everywhere_k(problem: Problem, truth: RoomVolume) -> float | None:
    """What costs nothing without a plane: the air that leaves, everywhere."""
    leaving_k = leaving_excess_k(problem)
    if leaving_k is None:
        return None
    everywhere_k = problem.scene.air.ambient_temperature_k + leaving_k
    return round(float(rms(inner(truth.temperature_k) - everywhere_k)), 4)


def _within(found: Solution, truth: RoomVolume) -> float | None:
    """Share of the room's inner vertices that lie within two stated deviations."""
    if found.temperature_std_k is None:
        return None
    error = np.abs(values_at(truth, found, found.temperature_k) - truth.temperature_k)
    return round(float(np.mean(inner(error < 2 * values_at(truth, found, found.temperature_std_k)))), 3)
