"""The `airlens` command: collects the command modules and turns errors into one sentence and a status.

Exit status: 0 done, 1 failed, 2 bad usage or input, 130 interrupted.
"""

import importlib.metadata
import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

import app
from app.commands import COMMANDS
from app.commands.lazy import lazy_group
from app.files.compilation_cache import use_compilation_cache

PACKAGES = ("calibration", "core", "drivers")


def create_cli() -> typer.Typer:
    """Build the command line: its commands are imported when they are run."""
    cli = typer.Typer(
        cls=lazy_group(COMMANDS),
        name="airlens",
        help="See and measure the air in a room with one camera and one projector.",
        invoke_without_command=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",  # the other takes a unit in brackets for a style
    )
    cli.callback()(_airlens)
    return cli


def main() -> None:
    """Run the command line; every foreseen error ends in one sentence on standard error."""
    # No process that is started from here imports from the folder that the operator stands in.
    os.environ["PYTHONSAFEPATH"] = "1"
    use_compilation_cache()
    in_the_way = stranger()
    if in_the_way:
        _fail(in_the_way, 1)
    _run()


def _run() -> None:
    # Imported here: only now is it known that these are ours.
    from app.errors import AirlensError, BadInputError
    from calibration.errors import CalibrationError
    from core.setting import SettingError
    from drivers.errors import DeviceError

    try:
        create_cli()()
    except (BadInputError, CalibrationError, SettingError) as error:
        _fail(str(error), 2)
    except (AirlensError, DeviceError) as error:
        _fail(str(error), 1)
    except OSError as error:
        _fail(f"{error.strerror or error}: {error.filename or ''}. Nothing half-written was kept.", 1)
    except KeyboardInterrupt:
        _fail("Interrupted. What was finished before is kept; nothing half-written is.", 130)


def stranger() -> str:
    """Where another program's `core`, `drivers` or `calibration` would be imported, what to do; else nothing."""
    home = Path(app.__file__).resolve().parent.parent
    for name in PACKAGES:
        found = find_spec(name)
        place = Path(found.origin).resolve() if found and found.origin else None
        if place is None or place.parent.parent != home:
            return (
                f"The package {name!r} was found at {place}, not in {home}: another program's is in the way. "
                "Install airlens into an environment of its own, or take that folder off PYTHONPATH."
            )
    return ""


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"airlens {importlib.metadata.version('airlens')}")
        raise typer.Exit


def _airlens(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_version)
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        _where_you_are(context)


def _where_you_are(context: typer.Context) -> None:
    """In an experiment, or beside some: how they stand. Elsewhere: the commands, in the order of the work."""
    from app.commands import status

    here = Path()
    if (here / status.SETTINGS_FILE).exists():
        status.show(here)
    elif status.experiments_in(here):
        status.show_all(here)
    else:
        typer.echo(context.get_help())
        typer.echo(
            "Here is no experiment. See the chain: airlens demo. Your own: airlens new --template wall-jet"
        )


def _fail(message: str, status: int) -> None:
    print(f"airlens: {message}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
