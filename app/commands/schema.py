"""`airlens schema`."""

from typing import Annotated, Literal

import typer


def register(cli: typer.Typer) -> None:
    """Add `schema`."""
    cli.command()(schema)


def schema(
    what: Annotated[
        Literal["experiment", "answers"], typer.Argument(help="experiment.toml, or the answers of `new`.")
    ] = "experiment",
    markdown: Annotated[
        bool, typer.Option("--markdown", help="Print a reference of both for people: every key in a table.")
    ] = False,
) -> None:
    """Print the JSON Schema of experiment.toml, or of the answers, for editors."""
    import json

    from pydantic import TypeAdapter

    from app.experiment.folder import ExperimentSettings
    from app.setup.answers import Answers

    if markdown:
        from app.setup.reference import reference

        typer.echo(reference(), nl=False)
        return
    kind = ExperimentSettings if what == "experiment" else Answers
    typer.echo(json.dumps(TypeAdapter(kind).json_schema(), indent=2))
