"""`airlens bench reconstruct`: temperature error against solver seconds, for the grid and the network.

Both solve the same problem in one process, one after the other; CPU seconds, compilation apart.
"""

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from app.bench.parts.options import AsJson, Batch, Information, Layers, Out, Volume, Width, network
from app.files.durable import durable_path
from app.volume.file import RoomVolume, read_volume
from app.volume.measurement import synthetic_problem
from app.volume.scene import RigOptions
from app.volume.score import score_solution
from core.problem import Problem
from core.result import Solution
from core.solve.grid.grid import GridSettings, solve_grid
from core.solve.loop import LoopSettings
from core.solve.network.mlp import MlpSolveSettings, solve_mlp
from core.solve.regime import Regime
from core.watch import Growing, Row, Watch


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
    lines.append(_ratio(lines))
    _write(out, lines, truth, information, light)
    for line in lines:
        typer.echo(json.dumps(line) if as_json else "  ".join(f"{k} {v}" for k, v in line.items()))


class _Curve:
    """One line a record; the time of scoring is left out."""

    def __init__(self, truth: RoomVolume, **point: Any) -> None:
        self.lines: list[dict[str, Any]] = []
        self._truth, self._point, self._began_s = truth, point, time.process_time()

    def begin(self, **more: Any) -> None:
        """Now, knowing this besides."""
        self._point |= more
        self._began_s = time.process_time()

    def watch(self, row: Row, growing: Growing | None) -> None:
        """Score the air on the way."""
        if "compile_s" in row:
            self.begin(compile_s=round(float(row["compile_s"]), 2))
        if growing is not None:
            self.score(growing)

    def score(self, growing: Growing) -> None:
        """Score the air as it is now."""
        now_s = time.process_time()
        cpu_s = round(now_s - self._began_s, 2)
        self.lines.append({**self._point, "cpu_s": cpu_s, **errors(growing(), self._truth)})
        self._began_s += time.process_time() - now_s


def run_grid(problem: Problem, truth: RoomVolume, regime: Regime, cells: int) -> list[dict[str, Any]]:
    """Twice: the first run compiles."""
    settings = GridSettings(regime=regime, cells=cells, coarsest=min(cells, 32))
    compiling, curve = (_Curve(truth, method="grid", cells=cells) for _ in range(2))
    solve_grid(problem, settings, Watch(compiling.watch))
    curve.begin()
    found = solve_grid(problem, settings, Watch(curve.watch))
    compile_s = round(compiling.lines[-1]["cpu_s"] - curve.lines[-1]["cpu_s"], 2)
    curve.score(lambda: found)
    curve.lines[-1] |= {"compile_s": compile_s, "outcome": found.outcome.name}
    return curve.lines


def run_network(problem: Problem, truth: RoomVolume, settings: MlpSolveSettings) -> list[dict[str, Any]]:
    """Compiled before it begins."""
    curve = _Curve(truth, method="mlp")

    found = solve_mlp(problem, settings, Watch(curve.watch))
    best = {"method": "mlp best", **errors(found, truth), "outcome": found.outcome.name}
    return [*curve.lines, best]


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
    """How much sooner the grid has the least error that both have, and what it has at its end."""
    grid, network = ([line for line in lines if line["method"] == name] for name in ("grid", "mlp"))
    same_k = max(min(line["T_K"] for line in way) for way in (grid, network))
    spent = [next(line["cpu_s"] for line in way if line["T_K"] <= same_k) for way in (grid, network)]
    return {
        "method": "grid before mlp",
        "T_K": same_k,
        "grid_cpu_s": spent[0],
        "mlp_cpu_s": spent[1],
        "ratio": round(spent[1] / spent[0], 1),
        "end_of_grid": {name: grid[-1][name] for name in ("T_K", "cpu_s")},
        "end_of_mlp": {name: network[-1][name] for name in ("T_K", "cpu_s")},
    }


def _write(out: Path, lines: list[dict[str, Any]], truth: RoomVolume, information: str, light: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    with durable_path(out / "lines.jsonl") as path:
        path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    figure, axes = pyplot.subplots(figsize=(6, 4), constrained_layout=True)
    for name, mark in (("mlp", "-"), ("grid", "o-")):
        way = [line for line in lines if line["method"] == name]
        axes.plot([line["cpu_s"] for line in way], [line["T_K"] for line in way], mark, label=name)
    axes.set(xscale="log", yscale="log", xlabel="solver CPU seconds", ylabel="T rms error [K]")
    axes.set_title(f"{information} information, {light}, ambient {truth.ambient_k:.2f} K")
    axes.legend()
    with durable_path(out / "curves.png") as path:
        figure.savefig(path, dpi=120)
    pyplot.close(figure)
