"""`airlens displacement`."""

import json
from pathlib import Path
from typing import Annotated

import typer


def register(cli: typer.Typer) -> None:
    """Add `displacement`."""
    cli.command()(displacement)


def displacement(
    reference: Annotated[Path, typer.Argument(help="Picture of the pattern through still air.")],
    flow: Annotated[Path, typer.Argument(help="Picture of the pattern through the flow.")],
    output: Annotated[
        Path, typer.Option(help="NetCDF to write; a PNG of the same name is put beside.")
    ] = Path("displacement.nc"),
    window_px: Annotated[int, typer.Option(min=5, help="Averaging window [px].")] = 21,
    remove_drift: Annotated[
        bool, typer.Option("--remove-drift", help="Take the border's motion out.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Estimate the shift field between two pictures (TIFF or PNG), with its uncertainty."""
    import numpy as np

    from app.files.durable import write_durably
    from app.files.pictures import read_picture
    from app.report.displacement import shift_field, write_shift_field
    from app.report.figures import as_png, shift_field_figure

    field = shift_field(read_picture(reference), read_picture(flow), window_px, remove_drift)
    write_shift_field(output, field, f"{reference.name} to {flow.name}")
    picture = output.with_suffix(".png")
    png = as_png(shift_field_figure(field.displacement_px))
    write_durably(picture, lambda temporary: temporary.write_bytes(png))
    size = np.linalg.norm(field.displacement_px, axis=-1)
    summary = {
        "netcdf": str(output),
        "picture": str(picture),
        "median_px": float(np.median(size)),
        "p99_px": float(np.percentile(size, 99)),
        "median_std_px": float(np.median(field.std_px)),
        "drift_px": None if field.drift_px is None else field.drift_px.tolist(),
    }
    if as_json:
        typer.echo(json.dumps(summary, indent=1))
        return
    typer.echo(
        f"Shift {summary['median_px']:.3f} px in the median, {summary['p99_px']:.3f} px at the 99th percentile, "
        f"each known to {summary['median_std_px']:.3f} px (one sigma, median)."
    )
    typer.echo(f"field {output}\npicture {picture}")
