"""`airlens preview`: a picture and a quality line, now."""

import json
from pathlib import Path
from typing import Annotated

import typer


def register(cli: typer.Typer) -> None:
    """Add `preview`."""
    cli.command()(preview)


def preview(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder, whose rig names the camera.")],
    out: Annotated[Path | None, typer.Option(help="Write the picture here (PNG).")] = None,
    exposure_s: Annotated[float | None, typer.Option(help="Exposure time [s] of this picture.")] = None,
    view: Annotated[
        str | None, typer.Option(help="Which camera, by its view's name, where there are several.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Take one frame; print its level, contrast, focus and saturation with advice."""
    from app.experiment.folder import open_experiment
    from app.experiment.views import view_number
    from app.rig.frame_report import judge_frame, write_picture
    from app.rig.open import open_camera
    from drivers.settings import grab_settled, held

    opened = open_experiment(experiment)
    number = view_number(opened, view)
    with open_camera(opened, "still", number) as camera, held(camera, exposure_s):
        frame = grab_settled(camera)
        quality = judge_frame(camera, frame)
        info = camera.info
    if out is not None:
        write_picture(out, frame)
    if as_json:
        typer.echo(
            json.dumps({"camera": info.name, "picture": str(out) if out else None} | quality.as_json())
        )
        return
    typer.echo(f"{info.name}, {info.width_px} x {info.height_px}, {info.bits} bit: {quality.line}")
