"""`airlens bench rays`: error against time of the ray tracers."""

import json
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from app.bench.parts.operator_trade import operator_row
from app.bench.parts.ray_trade import CONTRASTS_K, FIELDS, STAND_OFFS_M, RayRow, ray_rows


def register(bench: typer.Typer) -> None:
    """Add the command."""
    bench.command("rays")(rays)


def rays(
    json_lines: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
    quick: Annotated[
        bool, typer.Option(help="10 K and 1500 K at 30 m, 64 steps, without the network: about a minute.")
    ] = False,
    plot: Annotated[Path | None, typer.Option(help="Write a figure of error against time here.")] = None,
) -> None:
    """Error against float64 and CPU time of each tracer, forward and with gradient."""
    fields = ("plume", "grid64") if quick else tuple(FIELDS)
    contrasts_k = (10.0, 1500.0) if quick else CONTRASTS_K
    stand_offs_m = (30.0,) if quick else STAND_OFFS_M
    rows = []
    for row in chain(
        [operator_row()],
        ray_rows(fields, contrasts_k, stand_offs_m, (64,) if quick else (16, 64, 256)),
    ):
        rows.append(row)
        if json_lines:
            typer.echo(json.dumps(row.as_dict()))
    if not json_lines:
        Console().print(_table(rows))
    if plot is not None:
        _draw(rows, plot)


def _table(rows: list[RayRow]) -> Table:
    table = Table(title="Rays: per CPU second; memory of the gradient of 40,000 rays")
    for name in (
        "field",
        "tracer",
        "dT [K]",
        "stand-off [m]",
        "steps",
        "error",
        "rays/s",
        "with gradient",
        "MB",
    ):
        table.add_column(name, justify="left" if name in ("field", "tracer") else "right")
    for r in rows:
        table.add_row(
            r.field, r.tracer, f"{r.dT_K:g}", f"{r.stand_off_m:g}", str(r.steps), f"{r.rel_error:.1e}",
            f"{r.forward_rays_per_s:,.0f}", f"{r.gradient_rays_per_s:,.0f}", f"{r.peak_memory_mb:.0f}",
        )  # fmt: skip
    return table


def _draw(rows: list[RayRow], path: Path) -> None:
    """Error against CPU seconds a million rays, one colour a tracer, one marker a field."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot()
    colours = {
        "operator": "black",
        "straight": "tab:blue",
        "quasi_linear": "tab:orange",
        "nonlinear": "tab:red",
    }
    markers = {"plume": "o", "grid64": "s", "network4x128": "^"}
    for key in dict.fromkeys((r.field, r.tracer) for r in rows):
        chosen = [r for r in rows if (r.field, r.tracer) == key]
        axes.loglog(
            [1e6 / r.forward_rays_per_s for r in chosen], [r.rel_error for r in chosen],
            markers[key[0]], color=colours[key[1]], label=" ".join(key), alpha=0.6,
        )  # fmt: skip
    axes.set_xlabel("CPU seconds a million rays, forward")
    axes.set_ylabel("relative error of the wall shift")
    axes.legend(fontsize=7, ncols=2)
    figure.savefig(path, dpi=110)
