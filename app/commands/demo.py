"""`airlens demo`."""

import shutil
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn


def register(cli: typer.Typer) -> None:
    """Add `demo`."""
    cli.command()(demo)


def demo(
    folder: Annotated[
        Path, typer.Argument(help="Where to put the experiment; replaced if it is a demo.")
    ] = Path("demo"),
    camera_px: Annotated[int, typer.Option(min=64, help="Width of the simulated camera [px].")] = 2048,
    frames: Annotated[int, typer.Option(min=1, help="Frames averaged in each capture.")] = 100,
) -> None:
    """The whole chain on a packaged room: simulate a rig, capture, reconstruct, report."""
    from app.simulate.demo import run_demo

    console = Console()
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with (
        Progress(*columns, console=console) as progress,
        as_file(files("app.simulate.sample") / "room.npz") as room,
    ):
        task = progress.add_task("start", total=None)
        story = run_demo(
            folder, room, camera_px, frames, lambda name: progress.update(task, description=name)
        )
        progress.update(task, description="done")
    for sentence in story.sentences:
        console.print(sentence, soft_wrap=True)
    console.print(f"\nReport: {story.report}", soft_wrap=True)
    width = shutil.get_terminal_size().columns
    console.print("Open it in a browser; it needs no network."[:width])
