"""`airlens demo`."""

import shlex
import time
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console, Group
from rich.live import Live
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Table

if TYPE_CHECKING:
    from app.simulate.demo import Story
    from core.watch import Growing

# Where `airlens serve` looks, so that the page has the demo's experiment.
FOLDER = Path("airlens-data/experiments/demo")
_SKETCH_S = 2.0


def register(cli: typer.Typer) -> None:
    """Add `demo`."""
    cli.command()(demo)


def demo(
    folder: Annotated[
        Path, typer.Argument(help="Where to put the experiment; replaced if it is a demo.")
    ] = FOLDER,
    camera_px: Annotated[int, typer.Option(min=64, help="Width of the simulated camera [px].")] = 1536,
    frames: Annotated[int, typer.Option(min=1, help="Frames averaged in each capture.")] = 50,
    cells: Annotated[int, typer.Option(min=8, help="Cells along the room: finer takes longer.")] = 32,
) -> None:
    """The whole chain on a packaged room: simulate a lab's rig, capture, reconstruct, report."""
    from app.simulate.demo import Size, run_demo

    console = Console()
    with as_file(files("app.simulate.sample") / "room.npz") as room, _Shown(console) as shown:
        story = run_demo(folder, room, Size(camera_px, frames, cells), shown)
    _tell(console, story, folder)


class _Shown:
    """What is being done and how far it is; in a terminal also the air as it grows."""

    def __init__(self, console: Console) -> None:
        words = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
        self._console, self._bar = console, Progress(*words, TimeElapsedColumn(), console=console)
        self._task = self._bar.add_task("start", total=None)
        self._live = Live(self._bar, console=console, refresh_per_second=4, transient=True)
        self._drawn_s, self._said = 0.0, ""

    def __enter__(self) -> "_Shown":
        self._live.__enter__()
        return self

    def __exit__(self, *raised) -> None:
        self._live.__exit__(*raised)

    def __call__(self, stage: str, share: float | None, growing: "Growing | None") -> None:
        from app.commands.sketch import sketch

        total = None if share is None else 1.0
        self._bar.update(self._task, description=stage, total=total, completed=share or 0.0)
        words = stage.split(":")[0]
        if not self._console.is_terminal and words != self._said:
            self._console.print(f"- {words}", soft_wrap=True)
        self._said = words
        if growing is not None and self._console.is_terminal and time.monotonic() > self._drawn_s + _SKETCH_S:
            self._live.update(Group(sketch(growing()), self._bar))
            self._drawn_s = time.monotonic()


def _tell(console: Console, story: "Story", folder: Path) -> None:
    from app.commands.sketch import sketch
    from app.report.beside import rows

    if console.is_terminal:
        console.print(sketch(story.solution))
    for sentence in story.sentences:
        console.print(sentence, soft_wrap=True)
    table = Table("place", "temperature (95 %)", "true", "speed (95 %)", "true")
    for row in rows(story.places):
        table.add_row(*row)
    console.print(table)
    held_t, held_u = story.held
    console.print(
        f"In the whole room temperature is wrong by {story.temperature_error_k:.2f} K (rms) and velocity by "
        f"{story.velocity_error:.2f} of its rms; {100 * held_t:.0f} % and {100 * held_u:.0f} % of the places lie "
        "in their 95 % intervals.",
        soft_wrap=True,
        highlight=False,
    )
    console.print(f"\nReport: {story.report}", soft_wrap=True)
    if folder.parent.name == "experiments":
        data = "" if folder == FOLDER else f" {shlex.quote(str(folder.parent.parent))}"
        console.print(
            f"See it move: airlens serve{data}, and open the address that it prints.", soft_wrap=True
        )
    console.print(
        f"Go on with it: airlens reconstruct {shlex.quote(str(folder))} --preset reference", soft_wrap=True
    )
