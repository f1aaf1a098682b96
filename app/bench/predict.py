"""`airlens bench predict`: what a plan says of a room before, beside what solving it then takes and finds.

The rooms are ones that neither the cost model nor the table of errors was made from. One row a room, level
of information and preset: the shift's noise, solver seconds and T error, predicted over found.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from app.bench.parts.isolated import alone
from app.plan.make import preset_lines, signals_of
from app.reconstruct.presets import PRESETS
from app.volume.file import read_volume
from app.volume.measurement import known_planes, synthetic_problem
from app.volume.scene import Information, RigOptions, room_scene
from app.volume.score import score_solution
from core.displacement import resolve_window_px, standard_deviation_px
from core.plan.expected import expected_flow
from core.problem import Problem

_LEVELS: tuple[Information, ...] = ("surveyed", "operator")


def register(bench: typer.Typer) -> None:
    """Add `predict`."""
    bench.command("predict")(predict)


def predict(
    volumes: Annotated[list[Path], typer.Argument(help="Rooms (NPZ) that no figure was fitted to.")],
    presets: Annotated[list[str], typer.Option("--preset", help="Which to solve.")] = ["draft", "standard"],  # noqa: B006
    camera_px: Annotated[tuple[int, int], typer.Option(help="Camera.")] = (4096, 3072),
    light: Annotated[str, typer.Option(help="texture or projector.")] = "texture",
    as_json: Annotated[bool, typer.Option("--json", help="One JSON line a row.")] = False,
) -> None:
    """Hold the plan's predictions against what then happens, on rooms that they were not fitted to."""
    options = RigOptions(camera_px=camera_px, light=light)  # type: ignore[arg-type]
    for volume in volumes:
        for information in _LEVELS:
            for row in compared(volume, options, information, presets):
                typer.echo(json.dumps(row) if as_json else sentence(row))


def compared(
    path: Path, options: RigOptions, information: Information, presets: list[str]
) -> Iterator[dict[str, Any]]:
    """The rows of one room at one level."""
    volume = read_volume(path)
    scene = room_scene(volume, options, information)
    problem = Problem(scene, (), known_planes(volume, scene))
    flow = expected_flow(problem)
    signals = signals_of(problem, flow)
    for line in (line for line in preset_lines(problem, flow) if line.preset in presets and line.fits):
        found, _ = alone(solved, path, options, information, line.preset)
        yield {
            "room": path.stem, "information": information, "light": options.light, "preset": line.preset,
            "noise_px": _pair(signals[0].noise.mean_px, found["noise_px"]),
            "solver_s": _pair(line.solver_s, found["solver_s"]),
            "T_K": _pair(line.temperature_error_k, found["T_K"]),
            "u": _pair(line.velocity_error, found["u"]),
        }  # fmt: skip


def solved(path: Path, options: RigOptions, information: Information, preset: str) -> dict[str, Any]:
    """Measure and solve one room by one preset."""
    volume = read_volume(path)
    window_px = resolve_window_px(scene := room_scene(volume, options, information), scene.views[0])
    problem = synthetic_problem(volume, options, information, window_px=window_px, seed=1)
    noise = np.median(standard_deviation_px(problem.shifts[0]), axis=0)
    found = PRESETS[preset](problem)
    scores = score_solution(found, volume)
    return {
        "noise_px": float(np.sqrt(np.mean(noise**2))),
        "solver_s": found.solver_s,
        "T_K": scores["T"]["air"]["rms_K"],
        "u": scores["u"] and scores["u"]["rel"],
    }


def _pair(predicted: float | None, found: float | None) -> dict[str, float | None]:
    ratio = predicted / found if predicted is not None and found else None
    pair = {"predicted": predicted, "found": found, "ratio": ratio}
    return {name: None if value is None else float(f"{value:.4g}") for name, value in pair.items()}


def sentence(row: dict[str, Any]) -> str:
    """A row as a person reads it: predicted / found."""
    words = [f"{row['room']} {row['information']} {row['preset']}:"]
    for name in ("noise_px", "solver_s", "T_K", "u"):
        pair = row[name]
        if pair["ratio"] is not None:
            words.append(f"{name} {pair['predicted']:g} / {pair['found']:g} ({pair['ratio']:.2f}x)")
    return "  ".join(words)
