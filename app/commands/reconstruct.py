"""`airlens reconstruct`."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

# Known here by name, so that a shell completes them without what they solve with.
PRESETS = ("auto", "draft", "standard", "reference", "grid", "paper")


def register(cli: typer.Typer) -> None:
    """Add `reconstruct`."""
    cli.command()(reconstruct)


def reconstruct(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    preset: Annotated[
        str,
        typer.Option(
            autocompletion=lambda: list(PRESETS),
            help="How to solve: draft, standard, reference, grid, paper; auto is standard where walls and "
            "supply are stated, else draft.",
        ),
    ] = "auto",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Reconstruct the air from the newest reference and flow captures."""
    from app.pipeline import reconstruct as run

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, transient=True, disable=as_json) as progress:
        task = progress.add_task("start", total=None)
        current = ["start"]

        def stage(name: str) -> None:
            current[0] = name
            progress.update(task, description=name)

        def event(row: dict[str, Any]) -> None:
            progress.update(task, description=f"{current[0]}: iteration {row.get('iteration', 0):.0f}")

        done = run(experiment, preset, on_stage=stage, on_event=event)
    summary = {
        "result": str(done.folder / "result.nc"),
        "report": done.no_report or str(done.folder / "report.html"),
        "outcome": done.solution.outcome.name,
        "advice": done.solution.outcome.value,
        "solver_s": done.solution.solver_s,
        "wall_s": done.wall_s,
    }
    if as_json:
        typer.echo(json.dumps(summary, indent=1))
    else:
        typer.echo(f"{summary['outcome']}: {summary['advice']} Solver {done.solution.solver_s:.1f} s.")
        typer.echo(f"result {summary['result']}\nreport {summary['report']}")
