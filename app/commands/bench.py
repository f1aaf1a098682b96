"""`airlens bench`: measurements of the trade of speed for accuracy, run by hand."""

import typer

from app.bench import BENCHES
from app.commands.lazy import lazy_group


def register(cli: typer.Typer) -> None:
    """Add `bench` and every benchmark of `app.bench`."""
    bench = typer.Typer(
        cls=lazy_group(BENCHES), no_args_is_help=True, help="Measure speed and the error that it bought."
    )

    @bench.callback()
    def _bench() -> None: ...

    cli.add_typer(bench, name="bench")
