"""`airlens new`."""

import sys
from pathlib import Path
from typing import Annotated

import typer


def register(cli: typer.Typer) -> None:
    """Add `new`."""
    cli.command()(new)


def new(
    experiment: Annotated[Path | None, typer.Argument(help="New experiment folder.")] = None,
    source: Annotated[
        str, typer.Option("--from", help="Answers: a TOML file, or - for standard input.")
    ] = "",
    template: Annotated[
        str,
        typer.Option(
            help="Print answers to fill in: wall-jet, displacement, radiator, chilled-ceiling, empty or sample."
        ),
    ] = "",
) -> None:
    """Make an experiment for your rig and room from answers that a tape measure and a thermometer give."""
    from app.errors import BadInputError
    from app.setup.experiment import new_experiment
    from app.setup.experiment import template as template_text

    if template:
        typer.echo(template_text(template), nl=False)
        return
    if experiment is None or not source:
        raise BadInputError(
            "Answers are missing. Print some with `airlens new --template wall-jet > answers.toml`, change them to "
            "your room, then: airlens new EXPERIMENT --from answers.toml"
        )
    made = new_experiment(experiment, _text(source), "standard input" if source == "-" else source)
    typer.echo(f"{made.folder}: {_told(made)} Next: airlens preview {made.folder}")


def _text(source: str) -> str:
    from app.errors import BadInputError
    from app.files.reading import reading

    path = Path(source)
    if source != "-" and not path.is_file():
        raise BadInputError(
            f"There is no file {source}. `airlens new --template wall-jet` prints one to fill in."
        )
    with reading(path, "Write it in UTF-8."):
        return sys.stdin.read() if source == "-" else path.read_text(encoding="utf-8")


def _told(made) -> str:
    from app.setup.scene import picture_on_wall_m
    from core.scene import Inlet

    scene = made.settings.scene
    width_m, height_m = picture_on_wall_m(scene.views[0].camera, scene.room)
    parts = [
        f"the camera sees {width_m:.2f} x {height_m:.2f} m of a wall of "
        f"{scene.room.size_m[0]:g} x {scene.room.size_m[2]:g} m."
    ]
    for item in scene.boundary:
        if isinstance(item, Inlet):
            speed_m_s = sum(v * v for v in item.velocity_m_s) ** 0.5
            parts.append(
                f"Supply on {item.patch.wall}: {speed_m_s:.3g} m/s, {item.temperature_k - 273.15:.4g} C."
            )
    return " ".join(parts)
