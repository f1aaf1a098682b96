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

from app.benches.reconstruct import errors
from app.durable import durable_path
from app.paper_setup import paper_problem
from app.room_scene import RigOptions
from app.synthetic_problem import synthetic_problem
from app.truth import RoomVolume, read_volume
from core.mlp import MlpSettings
from core.problem import Problem
from core.result import Solution
from core.solve.grid import GridSettings, solve_grid
from core.solve.loop import LoopSettings
from core.solve.mlp import MlpSolveSettings, solve_mlp
from core.solve.regime import REGIMES, Regime


def register(bench: typer.Typer) -> None:
    """Add `regimes`."""
    bench.command("regimes")(regimes)


def regimes(
    volume: Annotated[Path, typer.Argument(help="Room volume (NPZ) that is the truth.")],
    out: Annotated[Path, typer.Option(help="Folder for lines.jsonl and the pictures.")] = Path("bench"),
    setup: Annotated[str, typer.Option(help="paper, texture or projector.")] = "paper",
    information: Annotated[str, typer.Option(help="paper, operator or surveyed.")] = "paper",
    method: Annotated[str, typer.Option(help="grid or mlp.")] = "grid",
    cells: Annotated[int, typer.Option(help="Cells an axis of the grid.")] = 32,
    network_s: Annotated[float, typer.Option(help="Seconds for the network.")] = 120.0,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON line a regime.")] = False,
) -> None:
    """Each regime of losses on one volume: errors of T, p, u, and pictures of truth, prediction and error."""
    truth = read_volume(volume)
    if setup == "paper":
        problem = paper_problem(truth, seed=0)
    else:
        options = RigOptions(light=setup)  # type: ignore[arg-type]
        problem = synthetic_problem(truth, options, information, window_px=32, seed=0)  # type: ignore[arg-type]
    lines, found = [], {}
    for regime in REGIMES:
        began = time.process_time()
        found[regime] = _solve(problem, regime, method, cells, network_s)
        point = {"setup": setup, "information": information, "method": method, "regime": regime}
        cpu_s = round(time.process_time() - began, 2)
        lines.append({**point, **errors(found[regime], truth), "cpu_s_with_compilation": cpu_s})
        typer.echo(json.dumps(lines[-1]) if as_json else "  ".join(f"{k} {v}" for k, v in lines[-1].items()))
    with durable_path(out / f"regimes_{setup}_{method}.jsonl") as path:
        path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    draw(out / f"regimes_{setup}_{method}.png", truth, found)


def _solve(problem: Problem, regime: Regime, method: str, cells: int, network_s: float) -> Solution:
    if method == "grid":
        return solve_grid(problem, GridSettings(regime=regime, cells=cells, coarsest=min(cells, 32)))
    settings = MlpSolveSettings(
        regime=regime,
        network=MlpSettings(),
        loop=LoopSettings(time_limit_s=network_s),
    )
    return solve_mlp(problem, settings)


def draw(path: Path, truth: RoomVolume, found: dict[Regime, Solution]) -> None:
    """Truth and each regime's temperature in the middle plane across the view; the error below."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    middle = len(truth.y_m) // 2
    exact = truth.temperature_k[:, middle]
    low, high = np.percentile(exact, [1, 99])
    columns = 1 + len(found)
    figure, axes = pyplot.subplots(2, columns, figsize=(3 * columns, 5), constrained_layout=True)
    extent = (truth.x_m[0], truth.x_m[-1], truth.z_m[0], truth.z_m[-1])

    def show(place: Any, values: np.ndarray, title: str, limits: tuple[float, float], colours: str) -> None:
        image = place.imshow(
            values.T, origin="lower", extent=extent, vmin=limits[0], vmax=limits[1], cmap=colours
        )
        place.set_title(title, fontsize=9)
        figure.colorbar(image, ax=place, shrink=0.7)

    show(axes[0, 0], exact, "truth [K]", (low, high), "inferno")
    axes[1, 0].axis("off")
    for column, (regime, solution) in enumerate(found.items(), start=1):
        predicted = _plane(solution, truth, truth.y_m[middle])
        show(axes[0, column], predicted, regime, (low, high), "inferno")
        show(axes[1, column], np.abs(predicted - exact), "error [K]", (0.0, 2.0), "viridis")
    with durable_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    pyplot.close(figure)


def _plane(solution: Solution, truth: RoomVolume, y_m: float) -> np.ndarray:
    from scipy.interpolate import RegularGridInterpolator

    axes = (solution.x_m, solution.y_m, solution.z_m)
    x, z = np.meshgrid(
        np.clip(truth.x_m, axes[0][0], axes[0][-1]),
        np.clip(truth.z_m, axes[2][0], axes[2][-1]),
        indexing="ij",
    )
    points = np.stack([x, np.full_like(x, y_m), z], axis=-1)
    return RegularGridInterpolator(axes, np.asarray(solution.temperature_k, np.float64))(points)
