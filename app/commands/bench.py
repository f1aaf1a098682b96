"""`airlens bench`: measurements of the trade of speed for accuracy, run by hand."""

import importlib
import pkgutil

import typer

import app.bench


def register(cli: typer.Typer) -> None:
    """Add `bench` and every benchmark in `app.bench`."""
    bench = typer.Typer(no_args_is_help=True, help="Measure speed and the error that it bought.")

    @bench.callback()
    def _bench() -> None: ...

    for module in sorted(m.name for m in pkgutil.iter_modules(app.bench.__path__)):
        importlib.import_module(f"app.bench.{module}").register(bench)
    cli.add_typer(bench, name="bench")
