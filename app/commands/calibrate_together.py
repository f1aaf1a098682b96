"""`airlens calibrate together`: several views adjusted at once, by what more than one of them sees."""

import json
import sys
from typing import Annotated

import typer

from app.calibrate.folder import CalibrationFolder
from app.calibrate.options import (
    AsJson,
    Bits,
    Dictionary,
    Discard,
    Every,
    Folder,
    Frames,
    Grid,
    Images,
    Kind,
    Marker,
    Retake,
    Square,
    chosen_board,
    full_scale,
    length_m,
    needed_board,
)
from app.calibrate.terminal import LiveOptions, run_together
from app.calibrate.together import add_pictures, lines, seats_of, summary
from app.calibrate.together import together as adjusted
from app.calibrate.together_live import PLACES, TogetherPlan
from app.errors import BadInputError
from calibration.errors import CalibrationError
from calibration.together import Stated


def register(cli: typer.Typer) -> None:
    """Add `together`."""
    cli.command()(together)


def together(
    experiment: Folder,
    images: Images = None,
    grid: Grid = "",
    square: Square = "",
    board: Kind = "chessboard",
    marker: Marker = None,
    dictionary: Dictionary = "DICT_5X5_250",
    bits: Bits = None,
    frames: Frames = 1,
    every_s: Every = None,
    places: Annotated[int, typer.Option(min=1, max=100, help="Live: how many places of the board.")] = PLACES,
    only: Annotated[
        bool, typer.Option("--only-adjust", help="Take no pictures: adjust by what is there already.")
    ] = False,
    tape_std: Annotated[
        str, typer.Option(help="Standard deviation of the places that were measured by tape: 5mm, 0.005.")
    ] = "5mm",
    retake: Retake = None,
    discard: Discard = False,
    as_json: AsJson = False,
) -> None:
    """Adjust several views together, by a board that their cameras see at the same time: live, or in pictures.

    With --images: one folder a camera, called by its name; pictures of the same file name were taken together.
    """
    folder = CalibrationFolder(experiment)
    if discard:
        folder.forget_shared()
        return
    try:
        stated = Stated(tape_std_m=length_m(tape_std, "--tape-std"))
    except CalibrationError as error:
        raise BadInputError(str(error)) from error
    seats_of(folder)  # refuses before anybody holds a board
    issues: tuple[str, ...] = ()
    if not only:
        target = needed_board(chosen_board(folder, board, grid, square, marker, dictionary))
        if images is None:
            plan = TogetherPlan(target, frames, places)
            issues = run_together(folder, plan, LiveOptions(every_s, retake=tuple(retake or ())))
        else:
            issues = add_pictures(folder, images, target, full_scale(bits), _say).issues
    content = summary(adjusted(folder, stated, issues))
    typer.echo(json.dumps(content, indent=1) if as_json else "\n".join(lines(content)))


def _say(name: str) -> None:
    if sys.stderr.isatty():
        typer.echo(f"reading {name}", err=True)
