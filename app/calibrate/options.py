"""Options of `airlens calibrate`, and what they mean: boards, lengths, places."""

import re
from pathlib import Path
from typing import Annotated

import typer

from app.calibrate.folder import CalibrationFolder
from app.calibrate.placement import placed
from app.errors import BadInputError
from app.experiment.folder import open_experiment
from app.experiment.views import view_names, view_number
from app.rig.conditions import Conditions
from calibration.board import Board, board_of
from calibration.board_kind import BoardKind
from calibration.errors import CalibrationError
from calibration.record import Placement
from core.scene import ProjectedPattern

Folder = Annotated[Path, typer.Argument(help="The experiment's folder.")]
Images = Annotated[Path | None, typer.Option(help="Folder of pictures; without it, live on the rig.")]
PatternOption = Annotated[
    str | None, typer.Option("--pattern", help="Which files, such as 'capture_*/graycode_*.png'.")
]
Kind = Annotated[BoardKind, typer.Option("--board", help="Kind of board.")]
Grid = Annotated[str, typer.Option("--grid", help="Inner corners, ChArUco squares, or circles: 9x7.")]
Square = Annotated[str, typer.Option("--square", help="Size of a square or spacing of circles: 75mm, 0.075.")]
Marker = Annotated[str | None, typer.Option("--marker", help="Size of a ChArUco marker (0.75 of a square).")]
Dictionary = Annotated[str, typer.Option("--dictionary", help="ChArUco dictionary.")]
CameraName = Annotated[
    str | None,
    typer.Option("--view", "--camera", help="Which view's camera, by its name, where there are several."),
]
Bits = Annotated[int | None, typer.Option("--bits", help="Bits of the camera, to see saturation.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Ambient = Annotated[
    float | None,
    typer.Option("--ambient-temperature-k", min=150, max=400, help="Temperature of the room [K]."),
]
MinutesOn = Annotated[
    float | None, typer.Option("--minutes-on", min=0, help="Minutes that the rig has been on (the lamp's).")
]
Frames = Annotated[int, typer.Option(min=1, max=1000, help="Live: frames averaged into one picture.")]
Settle = Annotated[float, typer.Option(min=0, max=60, help="Live: wait so long after each pattern [s].")]
Every = Annotated[
    float | None,
    typer.Option(min=0.5, max=600, help="Live: take a picture so often [s], hands free."),
]
Screen = Annotated[
    str, typer.Option(help="Live: kiosk (a page, opened on the projector), or a card such as /dev/dri/card0.")
]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Live: port of the kiosk page.")]
Retake = Annotated[
    list[str] | None, typer.Option(help="Live: forget this view first, such as view_03.png or place_02.")
]

Discard = Annotated[
    bool, typer.Option("--discard", help="Only forget what this step has taken and not completed.")
]


def make_board(kind: BoardKind, grid: str, square: str, marker: str | None, dictionary: str) -> Board:
    """The board that the options describe. Raises BadInputError."""
    columns, rows = size_of(grid, "--grid", "9x7")
    square_m = length_m(square, "--square")
    marker_m = None if marker is None else length_m(marker, "--marker")
    try:
        return board_of(kind, columns, rows, square_m, marker_m, dictionary)
    except CalibrationError as error:
        raise BadInputError(str(error)) from error


def make_placement(
    folder: CalibrationFolder,
    camera: str,
    anchor: str | None,
    camera_at: str | None,
    wall_y: float | None,
    plumb_px: str | None,
) -> Placement:
    """How the world lies, the wall's place from the experiment's room unless given. Raises BadInputError."""
    settings = folder.settings()
    if anchor is not None and camera_at is not None:
        raise BadInputError("Give --anchor or --camera-at, not both: each fixes the world's x and z.")
    line = None
    if plumb_px is not None:
        a, b, c, d = numbers(plumb_px, 4, "--plumb-px", "640,900,642,120")
        line = (a, b, c, d)
    if anchor is not None:
        u, v, *across = numbers(anchor, 4, "--anchor", "640,512,1.5,1.2")
        pixel = (u, v)
    else:
        across = None if camera_at is None else numbers(camera_at, 2, "--camera-at", "1.5,1.2")
        pixel = None
    if settings is not None:
        return placed(settings.scene, camera, pixel, across, wall_y, line)
    x, z = across or (0.0, 0.0)
    return Placement(pixel, x, z, wall_y, line)


def named_view(folder: CalibrationFolder, name: str | None) -> str:
    """The camera that is meant: of one view its own; of pictures without a scene `camera` unless named.

    Raises BadInputError for a name that no view has, and for none where there are several.
    """
    if folder.settings() is None:
        return name or "camera"
    experiment = open_experiment(folder.experiment)
    return view_names(experiment)[view_number(experiment, name)]


def panel_size(folder: CalibrationFolder, view: str, text: str | None) -> tuple[int, int]:
    """The pixels of a view's projector from the option, or from the experiment's scene. Raises BadInputError."""
    if text is not None:
        return size_of(text, "--projector-px", "1024x768")
    settings = folder.settings()
    if settings is not None:
        light = next(one.light or settings.scene.light for one in settings.scene.views if one.name == view)
        if isinstance(light, ProjectedPattern):
            return light.projector.width_px, light.projector.height_px
    raise BadInputError(
        "The projector's size is not known; give its native pixels, such as --projector-px 1024x768."
    )


def full_scale(bits: int | None) -> int | None:
    """The saturated count."""
    if bits is not None and not 1 <= bits <= 16:
        raise BadInputError(f"--bits is {bits}; expected 1 to 16.")
    return None if bits is None else 2**bits - 1


def size_of(text: str, option: str, example: str) -> tuple[int, int]:
    """`9x7` as two whole numbers. Raises BadInputError."""
    match = re.fullmatch(r"\s*(\d{1,5})\s*[xX×]\s*(\d{1,5})\s*", text)
    if match is None:
        raise BadInputError(f"{option} is {text!r}; expected two whole numbers such as {example}.")
    return int(match[1]), int(match[2])


def length_m(text: str, option: str) -> float:
    """`75mm`, `7.5cm`, `0.075m` or `0.075` in metres. Raises BadInputError."""
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(mm|cm|m)?\s*", text)
    try:
        value = float(match[1]) if match else float("nan")
    except ValueError:
        value = float("nan")
    if match is None or not value > 0:
        raise BadInputError(f"{option} is {text!r}; expected a length such as 75mm or 0.075 (metres).")
    return value * {"mm": 1e-3, "cm": 1e-2}.get(match[2] or "m", 1.0)


def numbers(text: str, count: int, option: str, example: str) -> list[float]:
    """`count` numbers between commas. Raises BadInputError."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        raise BadInputError(f"{option} is {text!r}; expected {count} numbers such as {example}.")
    return values


def chosen_board(
    folder: CalibrationFolder, kind: BoardKind, grid: str, square: str, marker: str | None, dictionary: str
) -> Board | None:
    """The board of the options, else of the experiment; None where neither tells. Raises BadInputError."""
    settings = folder.settings()
    if grid or square:
        return make_board(kind, grid, square, marker, dictionary)
    if settings is not None and settings.rig.board is not None:
        return settings.rig.board.board()
    return None


def needed_board(board: Board | None) -> Board:
    """The board. Raises BadInputError where there is none."""
    if board is None:
        raise BadInputError(
            "The board is not known; give --grid and --square, or a [rig.board] table in experiment.toml."
        )
    return board


def told(ambient_temperature_k: float | None, minutes_on: float | None) -> Conditions:
    """The conditions that the options tell."""
    return Conditions(ambient_temperature_k, minutes_on)
