"""The `airlens` command: collects the command modules and turns errors into one sentence and a status.

Exit status: 0 done, 1 failed, 2 bad usage or input, 130 interrupted.
"""

import importlib
import pkgutil
import sys

import typer

import app.commands
from app.errors import AirlensError, BadInputError
from app.files.compilation_cache import use_compilation_cache
from core.setting import SettingError
from drivers.errors import DeviceError


def create_cli() -> typer.Typer:
    """Build the command line from every module in `app.commands`."""
    cli = typer.Typer(
        name="airlens",
        help="See and measure the air in a room with one camera and one projector.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
    )
    for module in sorted(m.name for m in pkgutil.iter_modules(app.commands.__path__)):
        importlib.import_module(f"app.commands.{module}").register(cli)
    return cli


def main() -> None:
    """Run the command line; every foreseen error ends in one sentence on standard error."""
    use_compilation_cache()
    try:
        create_cli()()
    except (BadInputError, SettingError) as error:
        _fail(str(error), 2)
    except (AirlensError, DeviceError) as error:
        _fail(str(error), 1)
    except OSError as error:
        _fail(f"{error.strerror or error}: {error.filename or ''}. Nothing half-written was kept.", 1)
    except KeyboardInterrupt:
        _fail("Interrupted. What was finished before is kept; nothing half-written is.", 130)


def _fail(message: str, status: int) -> None:
    print(f"airlens: {message}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
