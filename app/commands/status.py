"""`airlens status`, and `airlens` alone: where you are, and what comes next."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

SETTINGS_FILE = "experiment.toml"


def register(cli: typer.Typer) -> None:
    """Add `status`."""
    cli.command()(status)


def status(
    experiment: Annotated[
        Path, typer.Argument(help="Experiment folder, or a folder of experiments.")
    ] = Path(),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what an experiment has, and which command comes next."""
    from app.errors import BadInputError

    if (experiment / SETTINGS_FILE).exists():
        show(experiment, as_json)
    elif experiments_in(experiment):
        show_all(experiment, as_json)
    else:
        raise BadInputError(
            f"{experiment.resolve()} is no experiment, and holds none. Make one: airlens new --template wall-jet"
        )


def experiments_in(folder: Path) -> list[Path]:
    """The experiments of a folder, or of a service's data folder, by name; loads nothing."""
    found = {
        path.parent for stem in ("*", "experiments/*") for path in folder.glob(f"{stem}/{SETTINGS_FILE}")
    }
    return sorted(path for path in found if not path.name.startswith("."))


def show(folder: Path, as_json: bool = False) -> None:
    """Print one experiment's whereabouts."""
    import dataclasses
    import json

    from app.whereabouts import whereabouts

    found = whereabouts(folder)
    if as_json:
        typer.echo(json.dumps(dataclasses.asdict(found), indent=1))
        return
    typer.echo(f"{found.title or folder.resolve().name} ({folder.resolve()})")
    width = max(map(len, found.has))
    for name, text in found.has.items():
        typer.echo(f"  {name:<{width}}  {text}")
    typer.echo(f"Next: {found.next.command}\n  ({found.next.reason}.)")


def show_all(folder: Path, as_json: bool = False) -> None:
    """Print the experiments of a folder, each with its next command."""
    import json

    from app.whereabouts import each

    rows = each(experiments_in(folder))
    if as_json:
        keys = ("experiment", "title", "next")
        typer.echo(json.dumps([dict(zip(keys, map(str, row), strict=True)) for row in rows], indent=1))
        return
    typer.echo(f"{len(rows)} experiment{'s' if len(rows) != 1 else ''} in {folder.resolve()}")
    for path, title, following in rows:
        typer.echo(f"  {path}  {title}\n    next: {following}")
    data = folder if (folder / "experiments").is_dir() else None
    if data is not None:
        typer.echo(f"The operator's page shows them: airlens serve {shlex.quote(str(data))}")
