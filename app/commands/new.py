"""`airlens new`."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from app.experiment.folder import Experiment
    from app.interview.conversation import Question


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
    """Make an experiment for your rig and room: asked question by question, or from a file of answers."""
    from app.errors import BadInputError
    from app.setup.experiment import new_experiment
    from app.setup.experiment import template as template_text
    from app.whereabouts import next_step

    if template:
        typer.echo(template_text(template), nl=False)
        return
    if experiment is None:
        raise BadInputError(
            "The experiment's folder is missing. `airlens new EXPERIMENT` asks for everything; with a file of "
            "answers: airlens new --template wall-jet > answers.toml, change it, airlens new EXPERIMENT --from "
            "answers.toml"
        )
    if source:
        made = new_experiment(experiment, _text(source), "standard input" if source == "-" else source)
    else:
        made = _asked(experiment)
    typer.echo(f"{made.folder}: {_told(made)} Next: {next_step(made, str(made.folder)).command}")


def _asked(folder: Path) -> "Experiment":
    from app.errors import BadInputError
    from app.interview.conversation import Piped
    from app.interview.talk import talk

    person = _Terminal() if sys.stdin.isatty() else Piped(sys.stdin.readline)
    try:
        return talk(folder, person)
    except EOFError as end:
        raise BadInputError(
            f"The answers ended before {str(end)!r}. They are kept; `airlens new {shlex.quote(str(folder))}` goes on "
            "there. "
            "`airlens new --template wall-jet` prints a file to fill in instead."
        ) from None
    except KeyboardInterrupt:
        typer.echo(
            f"\nWhat was answered is kept; `airlens new {shlex.quote(str(folder))}` goes on there.", err=True
        )
        raise typer.Exit(130) from None


class _Terminal:
    """A person at a terminal."""

    def hear(self, question: "Question") -> str:
        """Show the question, its options and its default; read a line."""
        for number, option in enumerate(question.options, 1):
            typer.echo(f"  {number}. {option}")
        typer.echo(
            f"{question.text} [{question.default}]: " if question.default else f"{question.text}: ", nl=False
        )
        line = sys.stdin.readline()
        if not line:
            raise EOFError(question.text)
        return line

    def say(self, text: str) -> None:
        """Show a text."""
        typer.echo(text)

    def refuse(self, question: "Question | None", reason: str) -> None:
        """Show what is wrong; the question comes again."""
        typer.echo(reason)


def _text(source: str) -> str:
    from app.errors import BadInputError
    from app.files.reading import reading

    path = Path(source)
    # A pipe is a file too: --from <(program).
    if source != "-" and (path.is_dir() or not path.exists()):
        raise BadInputError(
            f"There is no file {source}. `airlens new --template wall-jet` prints one to fill in."
        )
    with reading(path, "Write it in UTF-8."):
        return sys.stdin.read() if source == "-" else path.read_text(encoding="utf-8")


def _told(made: "Experiment") -> str:
    from app.setup.scene import picture_told
    from core.scene import Inlet

    scene = made.settings.scene
    parts = [picture_told(scene)]
    for item in scene.boundary:
        if isinstance(item, Inlet):
            speed_m_s = sum(v * v for v in item.velocity_m_s) ** 0.5
            parts.append(
                f"Supply on {item.patch.wall}: {speed_m_s:.3g} m/s, {item.temperature_k - 273.15:.4g} C."
            )
    return " ".join(parts)
