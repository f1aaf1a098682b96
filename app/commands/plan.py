"""`airlens plan`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

if TYPE_CHECKING:
    from app.plan.make import Plan


def register(cli: typer.Typer) -> None:
    """Add `plan`."""
    cli.command()(plan)


def plan(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    excess_k: Annotated[
        float | None, typer.Option(help="Largest temperature difference to expect [K].")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what this rig would see of this room, at what price, and what would help: before measuring."""
    from app.files.toml import to_plain
    from app.plan.make import plan as run

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, transient=True, disable=as_json) as progress:
        task = progress.add_task("start", total=None)
        made = run(
            experiment,
            excess_k=excess_k,
            on_stage=lambda stage: progress.update(task, description=stage),
        )
    if as_json:
        typer.echo(json.dumps(to_plain(made), indent=1))
    else:
        show(made)


def show(made: "Plan") -> None:
    """The plan as a person reads it."""
    from core.plan.signal import VISIBLE
    from core.plan.verdicts import BLIND

    console = Console()
    console.print(
        f"Expected: {made.expected}; {made.expected_departure_k:.2g} K rms about the mean at each height.\n"
    )
    best = max(view.picture_signal_to_noise for view in made.views)
    first = "bold red" if best < BLIND else "bold yellow" if best < VISIBLE else "bold"
    for place, sentence in enumerate(made.verdicts):
        console.print(f"- {sentence}", highlight=False, style=first if place == 0 else None)
    console.print(_presets(made))
    console.print(f"Times: {made.machine}.\n", highlight=False)
    console.print(_choices(made))


def _presets(made: "Plan") -> Table:
    from app.plan.promise import in_words

    table = Table(
        "preset", "time", "memory", "T error", "u error", "p error", "", title="what each preset would cost"
    )
    for line in made.presets:
        table.add_row(
            line.preset,
            "-" if line.wall_s is None else in_words(line.wall_s),
            "-" if line.memory_mb is None else f"{line.memory_mb:.0f} MB",
            "-" if line.temperature_error_k is None else f"{line.temperature_error_k:.2g} K",
            "-" if line.velocity_error is None else f"{100 * line.velocity_error:.0f} %",
            "-" if line.pressure_error is None else f"{100 * line.pressure_error:.0f} %",
            line.reason,
        )
    return table


def _choices(made: "Plan") -> Table:
    table = Table("auto", "choice", "bound", "limit", "cost", "why", title="what auto resolves to")
    for line in made.choices:
        unit = f" {line.unit}" if line.unit else ""
        table.add_row(
            line.name,
            str(line.value),
            f"{line.bound:.1g}{unit}" if line.limit else "-",
            f"{line.limit:.1g}{unit}" if line.limit else "-",
            f"{100 * line.cost_share:.0f} %",
            line.reason,
        )
    return table
