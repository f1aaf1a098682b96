"""`airlens calibrate`: camera, projector, wall and response, from pictures."""

import json
import re
import sys
import time
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from app.calibrate import Pictures, Step, calibrate_camera, calibrate_projector, calibrate_wall
from app.calibrate_response import calibrate_response, drift_between
from app.calibration_folder import CalibrationFolder
from app.calibration_page import write_page
from app.calibration_summary import lines, summary
from app.errors import AirlensError, BadInputError
from calibration.board import Board, CharucoBoard, Chessboard, CircleGrid
from calibration.errors import CalibrationError
from calibration.record import Placement
from calibration.strict import encode


class BoardKind(StrEnum):
    """Kinds of boards."""

    chessboard = "chessboard"
    charuco = "charuco"
    circles = "circles"
    asymmetric_circles = "asymmetric-circles"


Folder = Annotated[Path, typer.Argument(help="The experiment's folder.")]
Images = Annotated[Path, typer.Option(help="Folder of pictures.")]
PatternOption = Annotated[
    str | None, typer.Option("--pattern", help="Which files, such as 'capture_*/graycode_*.png'.")
]
Kind = Annotated[BoardKind, typer.Option("--board", help="Kind of board.")]
Grid = Annotated[str, typer.Option("--grid", help="Inner corners, ChArUco squares, or circles: 9x7.")]
Square = Annotated[str, typer.Option("--square", help="Size of a square or spacing of circles: 75mm, 0.075.")]
Marker = Annotated[str | None, typer.Option("--marker", help="Size of a ChArUco marker (0.75 of a square).")]
Dictionary = Annotated[str, typer.Option("--dictionary", help="ChArUco dictionary.")]
CameraName = Annotated[str, typer.Option("--camera", help="Which camera of the scene.")]
Bits = Annotated[int | None, typer.Option("--bits", help="Bits of the camera, to see saturation.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def register(cli: typer.Typer) -> None:
    """Add `calibrate` and its subcommands."""
    calibrate = typer.Typer(no_args_is_help=True, help="Calibrate camera, projector, wall and response.")
    for command in (camera, projector, wall, response, drift, page):
        calibrate.command()(command)
    cli.add_typer(calibrate, name="calibrate")


def camera(
    experiment: Folder,
    images: Images,
    grid: Grid,
    square: Square,
    pattern: PatternOption = None,
    board: Kind = BoardKind.chessboard,
    marker: Marker = None,
    dictionary: Dictionary = "DICT_5X5_250",
    camera: CameraName = "camera",
    bits: Bits = None,
    as_json: AsJson = False,
) -> None:
    """Fit the camera to pictures of a board (of a Gray-code sequence, the white frame is used)."""
    target = make_board(board, grid, square, marker, dictionary)
    pictures = Pictures(images, pattern, full_scale(bits))
    run(
        lambda say: calibrate_camera(CalibrationFolder(experiment), camera, pictures, target, say),
        as_json,
    )


def projector(
    experiment: Folder,
    images: Images,
    grid: Grid,
    square: Square,
    projector_px: Annotated[
        str | None, typer.Option(help="The projector's native pixels, such as 1024x768.")
    ] = None,
    pattern: PatternOption = None,
    board: Kind = BoardKind.chessboard,
    marker: Marker = None,
    dictionary: Dictionary = "DICT_5X5_250",
    camera: CameraName = "camera",
    bits: Bits = None,
    white_first: Annotated[bool, typer.Option(help="White and black come first, not last.")] = False,
    as_json: AsJson = False,
) -> None:
    """Fit camera and projector to Gray-code sequences on a board, one sequence for each place of it."""
    target = make_board(board, grid, square, marker, dictionary)
    pictures = Pictures(images, pattern, full_scale(bits), white_first)
    folder = CalibrationFolder(experiment)
    panel = panel_size(folder, projector_px)
    run(lambda say: calibrate_projector(folder, camera, pictures, target, panel, say), as_json)


def wall(
    experiment: Folder,
    images: Annotated[Path | None, typer.Option(help="Folder of one Gray-code sequence on the wall.")] = None,
    level_image: Annotated[
        Path | None, typer.Option(help="Picture of a board held level and flat against the wall.")
    ] = None,
    grid: Grid = "",
    square: Square = "",
    pattern: PatternOption = None,
    board: Kind = BoardKind.chessboard,
    marker: Marker = None,
    dictionary: Dictionary = "DICT_5X5_250",
    anchor: Annotated[
        str | None, typer.Option(help="A wall point seen at U,V whose world X,Z [m] were measured: U,V,X,Z.")
    ] = None,
    camera_at: Annotated[str | None, typer.Option(help="World X,Z [m] of the camera: X,Z.")] = None,
    wall_y: Annotated[float | None, typer.Option(help="World y of the wall [m].")] = None,
    plumb: Annotated[
        str | None, typer.Option(help="Lower and upper end of a vertical line on the wall: U,V,U,V.")
    ] = None,
    camera: CameraName = "camera",
    bits: Bits = None,
    as_json: AsJson = False,
) -> None:
    """Find the back wall and place camera and projector in the room."""
    folder = CalibrationFolder(experiment)
    level = None
    if level_image is not None:
        level = (level_image, make_board(board, grid, square, marker, dictionary))
    pictures = None if images is None else Pictures(images, pattern, full_scale(bits))
    placement = make_placement(folder, anchor, camera_at, wall_y, plumb)
    run(lambda say: calibrate_wall(folder, camera, pictures, level, placement, say), as_json)


def response(
    experiment: Folder,
    images: Annotated[Path, typer.Option(help="Folder with dark, grey_<level>, exposure_<seconds>.")],
    bits: Annotated[int, typer.Option(help="Bits of the camera.")],
    camera: CameraName = "camera",
    as_json: AsJson = False,
) -> None:
    """Measure dark level, gain, read noise, linearity, the projector's curve and the flat field."""
    full_scale(bits)
    bundle = calibrate_response(CalibrationFolder(experiment), camera, images, bits)
    found = bundle.response(camera)
    content = {"camera": encode(found), "projector": encode(bundle.projector_response)}
    if as_json or found is None:
        typer.echo(json.dumps(content, indent=1))
        return
    typer.echo(
        f"{camera}: {found.gain_counts_per_e:.4g} ± {found.gain_std_counts_per_e:.2g} counts an electron, "
        f"read noise {found.read_noise_e:.2f} e, full well {found.full_well_e:.0f} e, "
        f"dark {found.dark_counts:.2f} counts, nonlinearity {100 * found.nonlinearity:.2f} %"
    )
    if bundle.projector_response is not None:
        typer.echo(f"projector: gamma {bundle.projector_response.gamma:.3f}")
    typer.echo("".join(f"- {advice}\n" for advice in found.quality.advice), nl=False)


def drift(
    reference: Annotated[Path, typer.Argument(help="Picture before.")],
    flow: Annotated[Path, typer.Argument(help="Picture after.")],
    border: Annotated[int, typer.Option(min=8, help="Width of the border that is compared [px].")] = 96,
    marks: Annotated[
        list[str] | None, typer.Option(help="Box of printed marks X0,Y0,X1,Y1; may be repeated.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure what moved between two exposures: camera and, with printed marks, projector apart."""
    boxes = []
    for text in marks or []:
        x0, y0, x1, y1 = (int(v) for v in numbers(text, 4, "--marks", "10,10,120,120"))
        boxes.append((x0, y0, x1, y1))
    found = drift_between(reference, flow, border, tuple(boxes))
    parts = {"total": found.total.motion, "projector": found.projector}
    parts["camera"] = None if found.camera is None else found.camera.motion
    content = {
        name: None
        if motion is None
        else {
            "shift_px": motion.shift_px.tolist(),
            "rotation_rad": motion.rotation_rad,
            "scale": motion.scale,
        }
        for name, motion in parts.items()
    }
    content |= {"shift_std_px": found.total.shift_std_px, "advice": list(found.advice)}
    if as_json:
        typer.echo(json.dumps(content, indent=1))
        return
    for name, motion in parts.items():
        if motion is not None:
            x, y = motion.shift_px
            typer.echo(f"{name}: {x:+.4f}, {y:+.4f} px, {motion.rotation_rad * 1e6:+.1f} urad")
    typer.echo("".join(f"- {advice}\n" for advice in found.advice), nl=False)


def page(experiment: Folder, camera: CameraName = "camera") -> None:
    """Write the calibration's figures and advice as one HTML file."""
    typer.echo(write_page(CalibrationFolder(experiment), camera))


def run(step: Callable[[Callable[[str], None]], Step], as_json: bool) -> None:
    """Do a step, show its progress on standard error, print its outcome; exit status 1 if incomplete."""
    began = time.perf_counter()

    def say(name: str) -> None:
        if sys.stderr.isatty():
            typer.echo(f"reading {name}", err=True)

    try:
        done = step(say)
    except CalibrationError as error:
        raise BadInputError(str(error)) from error
    content = summary(done, time.perf_counter() - began)
    typer.echo(json.dumps(content, indent=1) if as_json else "\n".join(lines(content)))
    if done.model is None:
        raise AirlensError(
            "The calibration is not complete. What was found is kept; add the pictures named above."
        )


def make_board(kind: BoardKind, grid: str, square: str, marker: str | None, dictionary: str) -> Board:
    """The board that the options describe. Raises BadInputError."""
    columns, rows = size_of(grid, "--grid", "9x7")
    square_m = length_m(square, "--square")
    try:
        if kind is BoardKind.chessboard:
            return Chessboard(columns, rows, square_m)
        if kind is BoardKind.charuco:
            marker_m = 0.75 * square_m if marker is None else length_m(marker, "--marker")
            return CharucoBoard(columns, rows, square_m, marker_m, dictionary)
        return CircleGrid(columns, rows, square_m, kind is BoardKind.asymmetric_circles)
    except CalibrationError as error:
        raise BadInputError(str(error)) from error


def make_placement(
    folder: CalibrationFolder,
    anchor: str | None,
    camera_at: str | None,
    wall_y: float | None,
    plumb: str | None,
) -> Placement:
    """How the world lies, the wall's y from the experiment's room unless given. Raises BadInputError."""
    settings = folder.settings()
    if wall_y is None and settings is not None:
        wall_y = settings.scene.room.upper_m[1]
    if anchor is not None and camera_at is not None:
        raise BadInputError("Give --anchor or --camera-at, not both: each fixes the world's x and z.")
    line = None
    if plumb is not None:
        a, b, c, d = numbers(plumb, 4, "--plumb", "640,900,642,120")
        line = (a, b, c, d)
    if anchor is not None:
        u, v, x, z = numbers(anchor, 4, "--anchor", "640,512,1.5,1.2")
        return Placement((u, v), x, z, wall_y, line)
    x, z = (0.0, 0.0) if camera_at is None else numbers(camera_at, 2, "--camera-at", "1.5,1.2")
    return Placement(None, x, z, wall_y, line)


def panel_size(folder: CalibrationFolder, text: str | None) -> tuple[int, int]:
    """The projector's pixels from the option, or from the experiment's scene. Raises BadInputError."""
    if text is not None:
        return size_of(text, "--projector-px", "1024x768")
    settings = folder.settings()
    if settings is not None and settings.scene.light.kind == "projector":
        optics = settings.scene.light.projector
        return optics.width_px, optics.height_px
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
