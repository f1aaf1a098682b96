"""`airlens bench tradeoff`: what each preset and size buys on reference rooms, and the front of the best.

One row a solve: room, level of information, light, preset, size, frames, solver seconds, and the yardstick's
errors. Rows are appended as they come, so that a sweep that is cut short is not lost. Ray model, steps and
projector order stand apart (rays.jsonl): what they change is a shift, and every solve takes straight rays.
"""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer

from app.bench.parts.ray_sweep import ray_sweep
from app.files.durable import durable_path
from app.plan.tradeoff import front, off_front, span, table
from app.reconstruct.problem import with_scene
from app.volume.file import RoomVolume, read_volume
from app.volume.measurement import synthetic_problem
from app.volume.misread import misread
from app.volume.scene import RigOptions
from app.volume.score import score_solution
from core.estimate.forward_runs import RoomSettings
from core.known import level_of
from core.metrics import departure, inner, rms
from core.plan.expected import largest_contrast_k
from core.problem import Problem
from core.result import Solution
from core.setting import SettingError
from core.solve.draft.draft import solve_draft
from core.solve.grid.grid import solve_grid
from core.solve.loop import LoopSettings
from core.solve.network.mlp import MlpSolveSettings, solve_mlp
from core.solve.recipes import grid_settings, regime_for
from core.solve.room import solve_room


@dataclass(frozen=True)
class TradePoint:
    """One place of the sweep; `preset` is the name that its settings have as a preset, if any."""

    method: str
    cells: int
    preset: str | None
    light: str = "texture"
    frames: int = 100
    information: tuple[str, ...] = ("surveyed", "operator", "paper")


POINTS = (
    TradePoint("draft", 16, None),
    TradePoint("draft", 24, None),
    TradePoint("draft", 48, "draft"),
    TradePoint("draft", 64, None),
    TradePoint("draft", 48, None, frames=10),
    TradePoint("draft", 48, None, frames=1000),
    TradePoint("draft", 48, "draft", light="projector"),
    TradePoint("grid", 32, "grid"),
    TradePoint("room", 24, None),
    TradePoint("room", 48, "standard"),
    TradePoint("room", 32, None),
    TradePoint("grid", 16, None),
    TradePoint("mlp", 0, None, information=("paper",)),
)
# A network for a time that any other road would long have finished in.
_NETWORK_S = 60.0
# A short solve is mostly compilation: it is run twice, and the second is kept.
_SHORT_S = 20.0


def register(bench: typer.Typer) -> None:
    """Add `tradeoff`."""
    bench.command("tradeoff")(tradeoff)


def tradeoff(
    volumes: Annotated[list[Path], typer.Argument(help="Reference rooms (NPZ).")],
    out: Annotated[Path, typer.Option(help="Folder for rows.jsonl, front.png and table.md.")] = Path("bench"),
    limit_s: Annotated[float, typer.Option(help="Start no further solve after this [s].")] = 3600.0,
    presets: Annotated[bool, typer.Option("--presets", help="Presets alone, without other sizes.")] = False,
    misread_by: Annotated[
        int | None, typer.Option("--misread", help="Entries are wrong as their deviations say: a seed.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON line a row.")] = False,
) -> None:
    """Sweep presets, sizes, frames and light over rooms; find what is best at each price."""
    began = time.monotonic()
    rows: list[dict[str, Any]] = []
    out.mkdir(parents=True, exist_ok=True)
    with (out / "rows.jsonl").open("w", encoding="utf-8") as file:
        points = [point for point in POINTS if point.preset or not presets]
        for row in sweep(volumes, lambda: time.monotonic() - began > limit_s, points, misread_by):
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
            typer.echo(json.dumps(row) if as_json else "  ".join(f"{k} {v}" for k, v in row.items()))
    with (out / "rays.jsonl").open("w", encoding="utf-8") as file:
        for path in volumes:
            file.writelines(json.dumps(row) + "\n" for row in ray_sweep(path.stem, read_volume(path)))
    with durable_path(out / "table.md") as path:
        path.write_text(table(rows), encoding="utf-8")
    draw(rows, out / "front.png")
    if not as_json:
        for sentence in judgement(rows):
            typer.echo(sentence)


def judgement(rows: list[dict[str, Any]]) -> Iterator[str]:
    """How wide the front is, and how far each preset lies from it."""
    for quantity, name in (("T_share", "T"), ("u", "u")):
        yield f"The front of {name} spans a factor of {span(rows, quantity):.0f} in time."
        for preset in dict.fromkeys(row["preset"] for row in rows if row["preset"]):
            off = off_front(rows, preset, quantity)
            if off is not None:
                yield f"{preset}: {name} error {off:.2f} times the best found in its time (median)."


def sweep(
    volumes: list[Path], is_over: Callable[[], bool], points: Sequence[TradePoint], misread_by: int | None
) -> Iterator[dict[str, Any]]:
    """Every point on every room at every level; the cheap ones first."""
    truths = {path.stem: read_volume(path) for path in volumes}
    for point in points:
        for name, truth in truths.items():
            for information in point.information:
                if is_over():
                    return
                row = solved(point, name, truth, information, misread_by)
                if row is not None:
                    yield row


def solved(
    point: TradePoint, name: str, truth: RoomVolume, information: str, misread_by: int | None
) -> dict[str, Any] | None:
    """One row; None where this method refuses what is known. Entries are exact without a seed `misread_by`."""
    options = RigOptions(light=point.light, frames=point.frames)  # type: ignore[arg-type]
    made = synthetic_problem(truth, options, information, window_px=32, seed=1)  # type: ignore[arg-type]
    cells = point.cells or made.scene.solve.grid
    stated = made.scene if misread_by is None else misread(made.scene, misread_by)
    scene = replace(stated, solve=replace(stated.solve, grid=cells))
    problem = with_scene(made, scene)
    try:
        found = _solve(point, problem)
        if found.solver_s < _SHORT_S:
            found = _solve(point, problem)
    except SettingError:
        return None
    scores = score_solution(found, truth)
    scale_k = rms(departure(inner(truth.temperature_k)))
    return {
        "room": name, "information": information, "level": level_of(problem), "light": point.light,
        "method": point.method, "preset": point.preset, "cells": point.cells, "frames": point.frames,
        "solver_s": round(found.solver_s, 2),
        "T_K": round(scores["T"]["rms_K"], 4), "T_share": round(scores["T"]["rms_K"] / scale_k, 3),
        "T_air_share": round(scores["T"]["air"]["rms_K"] / scale_k, 3),
        "T_air_contrast": round(scores["T"]["air"]["rms_K"] / (largest_contrast_k(problem) or scale_k), 4),
        "T_departure": _rounded(scores["T"]["departure_of_departures"]), "misread": misread_by,
        "u": _rounded(scores["u"] and scores["u"]["rel"]), "p": _rounded(scores["p"] and scores["p"]["rel"]),
        "outcome": found.outcome.name, "distrusts": any("distrust the velocity" in note for note in found.notes),
    }  # fmt: skip


def _solve(point: TradePoint, problem: Problem) -> Solution:
    if point.method == "draft":
        return solve_draft(problem)
    if point.method == "grid":
        return solve_grid(problem, grid_settings(problem))
    if point.method == "mlp":
        steps = LoopSettings(time_limit_s=_NETWORK_S)
        return solve_mlp(problem, MlpSolveSettings(regime=regime_for(problem), loop=steps))
    return solve_room(problem, RoomSettings(cells=point.cells, coarse_cells=point.cells * 2 // 3))


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 3)


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """T's departures against solver seconds, with the front of each room at each level."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=False)
    colours = {"draft": "tab:blue", "grid": "tab:green", "room": "tab:orange", "mlp": "tab:red"}
    for axis, quantity, label in ((axes[0], "T_share", "T error over departures"), (axes[1], "u", "u error")):
        for row in rows:
            if row[quantity] is not None:
                marker = {"surveyed": "o", "operator": "s", "paper": "^"}[row["information"]]
                axis.plot(row["solver_s"], row[quantity], marker, color=colours[row["method"]], alpha=0.6)
        best = front(rows, quantity)
        axis.plot([r["solver_s"] for r in best], [r[quantity] for r in best], "k-", lw=0.8)
        axis.set(xscale="log", yscale="log", xlabel="solver [s]", ylabel=label)
        axis.grid(alpha=0.3)
    for method, colour in colours.items():
        axes[0].plot([], [], "o", color=colour, label=method)
    axes[0].legend(fontsize=8, title="o surveyed, s operator, ^ paper", title_fontsize=8)
    with durable_path(path) as temporary:
        figure.savefig(temporary, dpi=120)
