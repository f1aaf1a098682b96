"""`airlens indoor`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from app.report.indoor import Indoor


def register(cli: typer.Typer) -> None:
    """Add `indoor`."""
    cli.command()(indoor)


def indoor(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    result: Annotated[Path | None, typer.Option(help="Result folder; the newest by default.")] = None,
    clothing: Annotated[float, typer.Option(help="Clothing [clo]: 0.5 light, 1.0 a suit.")] = 0.7,
    met: Annotated[float, typer.Option(help="Activity [met]: 1.0 sitting, 1.2 office work.")] = 1.2,
    humidity: Annotated[float, typer.Option(help="Relative humidity [%].")] = 50.0,
    from_walls: Annotated[
        float, typer.Option(help="Distance of the occupied zone from the walls [m].")
    ] = 0.6,
    source: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="Place of a source of pollution, x y z [m]: how well the air carries it off."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what the found air means for people and ventilation: draught, PMV, air change, heat, with intervals."""
    from app.files.toml import to_plain
    from app.report.indoor import IndoorAsked, indoor_of
    from core.comfort import Occupant
    from core.occupied import OccupiedZone

    asked = IndoorAsked(
        occupant=Occupant(clothing_clo=clothing, activity_met=met, relative_humidity=humidity / 100.0),
        zone=OccupiedZone(from_walls_m=from_walls),
        source_m=source,
    )
    found = indoor_of(experiment, result, asked)
    if as_json:
        typer.echo(json.dumps(to_plain(found), indent=1))
    else:
        show(found)


def show(found: "Indoor") -> None:
    """The table as a person reads it."""
    from app.report.indoor import told

    console, table = Console(), Table("quantity", "value", "95 % interval")
    for quantity in found.quantities:
        table.add_row(*told(quantity))
    console.print(table)
    for sentence in (*found.missing, *found.notes):
        console.print(f"- {sentence}", highlight=False)
