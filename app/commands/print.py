"""`airlens print`: what it prints, by name; imported when it is asked for."""

import typer

from app.commands.lazy import lazy_group

_MODULE = "app.commands.print_sheets"
SHEETS = {
    "pattern": (_MODULE, "Write each wall's printed pattern as a PDF at true scale, in sheets that overlap."),
    "board": (_MODULE, "Write a board to calibrate with as a PDF at true scale."),
}


def register(cli: typer.Typer) -> None:
    """Add `print` and what it prints."""
    sheets = typer.Typer(
        cls=lazy_group(SHEETS),
        no_args_is_help=True,
        help="Write the wall's pattern, or a board to calibrate with, as a PDF at true scale.",
    )

    @sheets.callback()
    def _sheets() -> None: ...

    cli.add_typer(sheets, name="print")
