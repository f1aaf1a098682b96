"""`airlens reconstruct`."""

import contextlib
import json
import shutil
import signal
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

from app.reconstruct.names import NAMES


def register(cli: typer.Typer) -> None:
    """Add `reconstruct`."""
    cli.command()(reconstruct)


def reconstruct(
    experiment: Annotated[Path, typer.Argument(help="Experiment folder.")],
    preset: Annotated[
        str,
        typer.Option(
            autocompletion=lambda: list(NAMES),
            help="How to solve: draft, standard, reference, grid, paper; auto is standard where walls and "
            "supply are stated, else draft.",
        ),
    ] = "auto",
    sequence: Annotated[
        bool, typer.Option("--sequence", help="Find the temperature of each burst of a sequence as well.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Reconstruct the air from the newest reference and flow captures. Ctrl-C stops; the same command goes on."""
    from app.experiment.folder import open_experiment
    from app.jobs.checkpoints import FolderStore
    from app.pipeline import reconstruct as run
    from app.plan.under_way import process_age_s
    from app.report.answer import advice, summary
    from core.watch import StoppedError, Watch

    kept = open_experiment(experiment).checkpoint_folder
    store = FolderStore(kept)
    if len(store) > 0:
        typer.echo(f"Going on from {kept}, where captures and settings are the same.", err=True)
    try:
        with _progress(quiet=as_json) as shown, _interruptible() as stop:
            watch = Watch(shown, stop.is_set, store)
            done = run(experiment, preset, sequence=sequence, watch=watch, start_s=process_age_s())
    except StoppedError:
        typer.echo(f"Stopped. What was done is kept in {kept}; the same command goes on from it.", err=True)
        raise typer.Exit(130) from None
    shutil.rmtree(kept, ignore_errors=True)
    answer, better = summary(done.finding), advice(done.finding)
    found = [one.sentence for one in done.measurement.found]
    result, report = str(done.folder / "result.nc"), done.no_report or str(done.folder / "report.html")
    outcome = done.solution.outcome
    if as_json:
        told = {
            "result": result,
            "report": report,
            "outcome": outcome.name,
            "advice": outcome.value,
            "answer": answer,
            "to_know_better": better,
            "solver_s": done.solution.solver_s,
            "wall_s": done.wall_s,
            "found": found,
            "promised_s": done.promised_s,
        }
        typer.echo(json.dumps(told, indent=1))
        return
    typer.echo(f"{outcome.name}: {outcome.value} Solver {done.solution.solver_s:.1f} s.")
    for sentence in (*answer, *found, *(f"To know better: {first}" for first in better[:1])):
        typer.echo(sentence)
    typer.echo(f"result {result}\nreport {report}")


class _Shown:
    """Shows on a bar what is being done, and how much of it is done where the solver can tell."""

    def __init__(self, bar: Progress) -> None:
        self._bar, self._task = bar, bar.add_task("start", total=None)

    def __call__(self, row: Mapping[str, float | str], growing: object) -> None:
        share, left_s = row.get("share"), row.get("left_s")
        if isinstance(share, float):
            self._bar.update(self._task, total=1.0, completed=share)
        if isinstance(left_s, float):
            self._bar.update(self._task, ends_s=time.monotonic() + left_s)
        if row.get("promised"):
            typer.echo(row["promised"], err=True)
        self._bar.update(self._task, description=str(row["doing"]))
        if str(row["doing"]).startswith("start afresh"):
            self._bar.console.print(f"{row['doing']}.")


class _Left(ProgressColumn):
    """How long yet, counted down from what was told last."""

    def render(self, task: Task) -> Text:
        """Nothing while it is not known."""
        ends_s = task.fields.get("ends_s")
        if ends_s is None:
            return Text("")
        left_s = ends_s - time.monotonic()
        return Text(f"about {left_s:.0f} s left" if left_s > 0 else "longer than usual")


@contextlib.contextmanager
def _progress(*, quiet: bool) -> Iterator[_Shown]:
    words = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(*words, TimeElapsedColumn(), _Left(), transient=True, disable=quiet) as bar:
        yield _Shown(bar)


@contextlib.contextmanager
def _interruptible() -> Iterator[threading.Event]:
    """Set the event at the first Ctrl-C or SIGTERM; a second one ends the program at once, which loses little."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    former = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def asked(*_: object) -> None:
        typer.echo("Stopping; a compilation is waited for. Once more stops at once.", err=True)
        stop.set()
        _restore(former)

    for number in former:
        signal.signal(number, asked)
    try:
        yield stop
    finally:
        _restore(former)


def _restore(former: Mapping[signal.Signals, object]) -> None:
    for number, handler in former.items():
        signal.signal(number, handler)  # pyright: ignore[reportArgumentType]
