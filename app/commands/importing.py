"""`airlens import`."""

from pathlib import Path
from typing import Annotated

import typer

Pictures = list[str]
_PATTERN = 'a file, a folder, or a pattern in quotes ("flow/*.tif"); may be given several times'


def register(cli: typer.Typer) -> None:
    """Add `import`."""
    cli.command("import")(bring)


def bring(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    reference: Annotated[Pictures, typer.Option(help=f"Pictures through still air: {_PATTERN}.")] = [],  # noqa: B006
    flow: Annotated[Pictures, typer.Option(help="Pictures with the air moving.")] = [],  # noqa: B006
    dark: Annotated[Pictures, typer.Option(help="Pictures with the lens covered.")] = [],  # noqa: B006
    flat: Annotated[Pictures, typer.Option(help="Pictures of an even, bright wall.")] = [],  # noqa: B006
    view: Annotated[
        str | None,
        typer.Option(help="Which camera took them, of an experiment with several views: the view's name."),
    ] = None,
    bits: Annotated[
        int | None,
        typer.Option(min=1, max=16, help="Bits of the counts, where files of 16 bits hold fewer."),
    ] = None,
    ambient_temperature_k: Annotated[
        float | None, typer.Option(min=150, max=400, help="Temperature of the room [K] (the scene's).")
    ] = None,
) -> None:
    """Make captures of pictures that another camera took: TIFF, PNG, JPEG, or raw files (by airlens[raw]).

    Of several views each camera's pictures are imported by themselves, in any order; a capture waits for the others.
    """
    from rich.progress import Progress as Bar

    from app.capture.imported import import_pictures
    from app.capture.watched import BurstWatch
    from app.commands.capture import said
    from app.experiment.folder import open_experiment
    from app.rig.conditions import Conditions
    from drivers.burst import CaptureRole

    opened = open_experiment(experiment)
    with Bar(transient=True) as bar:
        task = bar.add_task("pictures", total=None)
        watch = BurstWatch(progress=lambda now: bar.update(task, completed=now.done, total=now.total))
        names: dict[CaptureRole, list[str]] = {
            "reference": reference,
            "flow": flow,
            "dark": dark,
            "flat": flat,
        }
        taken = import_pictures(opened, names, bits, Conditions(ambient_temperature_k), watch, view)
    for one in taken:
        typer.echo(said(one))
        if one.failed:
            missing = ", ".join(map(repr, one.failed))
            typer.echo(
                f"  The {one.burst.plan.role} is whole once the pictures of {missing} are there: import them too."
            )
