"""`airlens bench regimes`: the paper's comparison of losses, as a table and as its figure.

The paper's set-up: camera (0.85, -29, 1.5) m, projector one metre to the right, 100 x 100 px, the plane
x_min known, evaluated on the truth's vertices. The default rig stands at the same place with 4096 x 3072 px.
"""

import json
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from app.bench.parts.options import AsJson, Batch, Information, Out, Volume, Width, network
from app.bench.parts.paper_setup import paper_problem
from app.bench.reconstruct import errors, trivial
from app.errors import BadInputError
from app.files.durable import durable_path
from app.volume.file import RoomVolume, read_volume
from app.volume.measurement import synthetic_problem
from app.volume.scene import RigOptions
from core.problem import Problem
from core.result import Solution
from core.solve.grid.grid import GridSettings, solve_grid
from core.solve.loop import LoopSettings
from core.solve.network.mlp import solve_mlp
from core.solve.regime import REGIMES, Regime


def register(bench: typer.Typer) -> None:
    """Add `regimes`."""
    bench.command("regimes")(regimes)


def regimes(
    volume: Volume,
    out: Out = Path("bench"),
    setup: Annotated[str, typer.Option(help="paper, texture or projector.")] = "paper",
    information: Information = "paper",
    image_std: Annotated[
        float | None, typer.Option(help="Of the paper set-up's pictures, full scale 1; else the camera's.")
    ] = None,
    method: Annotated[str, typer.Option(help="grid or mlp.")] = "grid",
    cells: Annotated[int, typer.Option(help="Cells an axis of the grid.")] = 64,
    network_steps: Annotated[int, typer.Option(help="Steps of the network, for each regime.")] = 500,
    limit_s: Annotated[float | None, typer.Option(help="Seconds for each regime.")] = None,
    width: Width = 128,
    batch: Batch = 8192,
    rays: Annotated[str, typer.Option(help="grid, or network: as published, sixty times slower.")] = "grid",
    only: Annotated[list[str] | None, typer.Option("--regime", help="One regime; again for more.")] = None,
    as_json: AsJson = False,
) -> None:
    """Each regime of losses on one volume: errors of T, p, u, and pictures of truth, prediction and error."""
    truth = read_volume(volume)
    problem = _problem(truth, setup, information, image_std)
    size = cells if method == "grid" else network_steps
    name = f"regimes_{setup}_{information}_{method}_{size}" + (
        "" if image_std is None else f"_std_{image_std:g}"
    )
    lines: list[dict[str, Any]] = []
    found: dict[Regime, Solution] = {}
    chosen: list[Regime] = [regime for regime in REGIMES if not only or str(regime) in only]
    for regime in chosen:
        began = time.process_time()
        if method == "grid":
            found[regime] = solve_grid(
                problem,
                GridSettings(regime=regime, cells=cells, coarsest=min(cells, 16), time_limit_s=limit_s),
            )
        else:
            loop = LoopSettings(steps=network_steps, time_limit_s=limit_s)
            found[regime] = solve_mlp(problem, network(regime, 4, width, batch, loop, rays))
        cpu_s = round(time.process_time() - began, 1)
        point = {"setup": setup, "information": information, **_pictures(problem)}
        point |= {"method": method, "size": size, "regime": regime}
        cost = {"solver_s": round(found[regime].solver_s, 1), "cpu_s_with_compilation": cpu_s}
        ended = {"outcome": found[regime].outcome.name, "iterations": _iterations(found[regime])}
        lines.append(
            {**point, **errors(found[regime], truth), **trivial(found[regime], truth), **cost, **ended}
        )
        typer.echo(json.dumps(lines[-1]) if as_json else "  ".join(f"{k} {v}" for k, v in lines[-1].items()))
        with durable_path(out / f"{name}.jsonl") as path:
            path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    draw(out / f"{name}.png", truth, found)


def _problem(truth: RoomVolume, setup: str, information: str, image_std: float | None) -> Problem:
    if setup == "paper":
        return paper_problem(truth, seed=0, image_std=image_std)
    if setup not in ("texture", "projector") or information not in ("paper", "operator", "surveyed"):
        raise BadInputError(
            f"Set-up {setup!r} with information {information!r}: expected paper, texture or projector with "
            "paper, operator or surveyed."
        )
    return synthetic_problem(truth, RigOptions(light=setup), information, window_px=32, seed=0)  # type: ignore[arg-type]


def _pictures(problem: Problem) -> dict[str, float]:
    """Where pictures are the data: their noise, and the median change of a lit pixel with it, full scale 1."""
    if not problem.images:
        return {}
    pair = problem.images[0]
    lit = pair.reference_image > 0
    change = np.median(np.abs(pair.flow_image - pair.reference_image)[lit])
    return {
        "image_std": float(f"{pair.difference_variance**0.5:.3g}"),
        "image_change": float(f"{change:.3g}"),
    }


def _iterations(found: Solution) -> int:
    """Steps of the network; conjugate gradients of all the grid's steps."""
    if not found.history:
        return 0
    last = found.history[-1]
    return int(last.get("step", sum(float(row.get("cg_iterations", 0.0)) for row in found.history)))


def draw(path: Path, truth: RoomVolume, found: dict[Regime, Solution]) -> None:
    """Truth, each regime's prediction and its error, as in the paper's figure: T and speed, middle plane."""
    from matplotlib.figure import Figure

    middle = len(truth.y_m) // 2
    exact = {
        "T": truth.temperature_k[:, middle],
        "|u|": np.linalg.norm(truth.velocity_m_s[:, middle], axis=-1),
    }
    predicted = {regime: _planes(solution, truth, truth.y_m[middle]) for regime, solution in found.items()}
    columns = 1 + len(found)
    figure = Figure(figsize=(3 * columns, 9.2), layout="constrained")
    axes = figure.subplots(4, columns)
    extent = (truth.x_m[0], truth.x_m[-1], truth.z_m[0], truth.z_m[-1])

    def show(place: Any, values: np.ndarray, title: str, limits: tuple[float, float], colours: str) -> None:
        image = place.imshow(
            values.T, origin="lower", extent=extent, vmin=limits[0], vmax=limits[1], cmap=colours
        )
        place.set_title(title, fontsize=9)
        figure.colorbar(image, ax=place, shrink=0.7)

    for row, (name, unit, colours, worst) in enumerate(
        (("T", "K", "inferno", 2.0), ("|u|", "m/s", "viridis", 0.3))
    ):
        low, high = (float(v) for v in np.percentile(exact[name], [1, 99]))
        show(axes[2 * row, 0], exact[name], f"{name}, truth [{unit}]", (low, high), colours)
        axes[2 * row + 1, 0].axis("off")
        for column, regime in enumerate(found, start=1):
            plane = predicted[regime][name]
            show(axes[2 * row, column], plane, regime, (low, high), colours)
            error = np.abs(plane - exact[name])
            show(axes[2 * row + 1, column], error, f"error [{unit}]", (0.0, worst), "magma")
    with durable_path(path) as temporary:
        figure.savefig(temporary, format="png", dpi=80)


def _planes(solution: Solution, truth: RoomVolume, y_m: float) -> dict[str, np.ndarray]:
    from scipy.interpolate import RegularGridInterpolator

    axes = (solution.x_m, solution.y_m, solution.z_m)
    x, z = np.meshgrid(
        np.clip(truth.x_m, axes[0][0], axes[0][-1]),
        np.clip(truth.z_m, axes[2][0], axes[2][-1]),
        indexing="ij",
    )
    points = np.stack([x, np.full_like(x, y_m), z], axis=-1)

    def at(values: np.ndarray) -> np.ndarray:
        return RegularGridInterpolator(axes, np.asarray(values, np.float64))(points)

    if solution.velocity_m_s is None:
        raise BadInputError("This solver finds no velocity; compare regimes with grid or mlp.")
    return {"T": at(solution.temperature_k), "|u|": np.linalg.norm(at(solution.velocity_m_s), axis=-1)}
