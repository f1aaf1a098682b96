"""`airlens score`."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table


def register(cli: typer.Typer) -> None:
    """Add `score`."""
    cli.command()(score)


def score(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    truth: Annotated[Path, typer.Option(help="Room volume (NPZ) to compare with.")],
    result: Annotated[Path | None, typer.Option(help="Result folder; the newest by default.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compare the newest result with a known room, beside the trivial answers."""
    from app.volume.score import score_experiment

    scores = score_experiment(experiment, truth, result)
    if as_json:
        typer.echo(json.dumps(scores, indent=1))
    else:
        Console().print(score_table(scores))


def score_table(scores: dict[str, Any]) -> Table:
    """The scores as a person reads them."""
    table = Table(
        "quantity", "error", "trivial answers", title=f"{scores['experiment']} ({scores['preset']})"
    )
    trivial = {"ambient": "T = T0", "inlet_plane": "inlet plane along x", "y_mean": "true mean along y"}
    t = scores["T"]
    others = ", ".join(f"{trivial[k]} {v:.3f} K" for k, v in t["trivial"].items())
    table.add_row("temperature, rms", f"{t['rms_K']:.3f} K", others)
    air = t["air"]
    table.add_row(
        "of the air, without walls' surfaces",
        f"{air['rms_K']:.3f} K",
        f"{trivial['inlet_plane']} {air['inlet_plane']:.3f} K",
    )
    table.add_row("temperature, of its departure", _number(t["rel_departure"]), "mean at each height 1")
    for name, label in (("u", "velocity"), ("p", "pressure")):
        if scores[name] is None:
            table.add_row(label, "not solved for", "")
        else:
            table.add_row(f"{label}, relative", _number(scores[name]["rel"]), f"{label} = 0: 1")
    if scores["u"] is not None:
        table.add_row("velocity in the jet, relative", _number(scores["u"]["jet_rel"]), "")
    held = {"T": scores["T_within"], "u": scores["u_within"], "p": scores["p_within"]}
    told = ", ".join(f"{name} {100 * share:.0f} %" for name, share in held.items() if share is not None)
    table.add_row("points within their 95 % intervals", told or "-", "wanted: 90 to 98 %")
    bursts = scores["bursts"]
    if bursts is not None:
        table.add_row(
            "temperature of a burst, rms",
            f"{bursts['rms_K']:.3f} K",
            f"the mean {bursts['mean_rms_K']:.3f} K",
        )
        table.add_row("departures from the mean, relative", _number(bursts["departure_rel"]), "the mean 1")
        table.add_row(
            "of bursts within their 95 % intervals", f"T {100 * bursts['within']:.0f} %", "wanted: 90 to 98 %"
        )
    table.add_row("solver", f"{scores['solver_s']:.1f} s", f"outcome {scores['outcome']}")
    return table


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
