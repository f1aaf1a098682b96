"""`airlens report` and `airlens export`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

Result = Annotated[Path | None, typer.Option(help="Result folder; the newest by default.")]


def register(cli: typer.Typer) -> None:
    """Add `report` and `export`."""
    cli.command()(report)
    cli.command()(export)


def report(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    result: Result = None,
    pdf: Annotated[bool, typer.Option("--pdf", help="Two pages of A4 to hand on, instead of HTML.")] = False,
) -> None:
    """Write the report of a result: one HTML file that needs no network, or two pages of PDF."""
    from app.report.export import export as exported
    from app.report.page import report_again

    typer.echo(str(exported(experiment, "pdf", None, result) if pdf else report_again(experiment, result)))


def export(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    kind: Annotated[
        Literal["nc", "h5", "vti", "csv", "zip", "png", "ply", "vtu", "pdf", "pvd"] | None,
        typer.Option(
            "--format",
            help="By the output's name, or nc; zip is an OpenFOAM case, ply a surface of one temperature, vtu paths "
            "of particles, pdf the report.",
        ),
    ] = None,
    output: Annotated[Path | None, typer.Option(help="File to write; beside the result by default.")] = None,
    result: Result = None,
    level_k: Annotated[
        float | None,
        typer.Option(help="ply: the surface's temperature [K]; half-way to the extreme by default."),
    ] = None,
) -> None:
    """Write a result for another program: NetCDF, ParaView, CSV, OpenFOAM, a picture, a surface, paths."""
    from app.report.export import export as run

    typer.echo(str(run(experiment, kind, output, result, level_k)))
