"""The steps of `airlens calibrate`: camera, projector, wall and response, live on the rig or from pictures."""

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.guide import LivePlan
from app.calibrate.options import (
    Ambient,
    AsJson,
    Bits,
    CameraName,
    Dictionary,
    Discard,
    Every,
    Folder,
    Frames,
    Grid,
    Images,
    Kind,
    Marker,
    MinutesOn,
    PatternOption,
    Port,
    Retake,
    Screen,
    Settle,
    Square,
    chosen_board,
    full_scale,
    make_placement,
    named_view,
    needed_board,
    numbers,
    panel_size,
    told,
)
from app.calibrate.page import write_page
from app.calibrate.response import calibrate_response, drift_between
from app.calibrate.steps import (
    Pictures,
    StepOutcome,
    calibrate_camera,
    calibrate_projector,
    calibrate_wall,
    modelled,
    put_to_use,
)
from app.calibrate.summary import lines, summary
from app.calibrate.terminal import LiveOptions, run_live
from app.errors import AirlensError, BadInputError
from app.rig.conditions import Conditions, conditions_of
from calibration.bundle import Bundle
from calibration.errors import CalibrationError
from calibration.strict import encode


def register(cli: typer.Typer) -> None:
    """Add the subcommands of `calibrate`."""
    for command in (camera, projector, wall, response, drift, page):
        cli.command()(command)


def camera(
    experiment: Folder,
    images: Images = None,
    grid: Grid = "",
    square: Square = "",
    pattern: PatternOption = None,
    board: Kind = "chessboard",
    marker: Marker = None,
    dictionary: Dictionary = "DICT_5X5_250",
    view: CameraName = None,
    bits: Bits = None,
    ambient_temperature_k: Ambient = None,
    minutes_on: MinutesOn = None,
    frames: Frames = 1,
    every_s: Every = None,
    retake: Retake = None,
    discard: Discard = False,
    as_json: AsJson = False,
) -> None:
    """Fit the camera to views of a board: live, or in pictures (of a Gray-code sequence, its white frame)."""
    folder = CalibrationFolder(experiment)
    camera = named_view(folder, view)
    if discard:
        folder.discard(StepName.camera, camera)
        return
    target = needed_board(chosen_board(folder, board, grid, square, marker, dictionary))
    known = told(ambient_temperature_k, minutes_on)
    if images is None:
        plan = LivePlan(StepName.camera, camera, target, frames)
        live(folder, plan, LiveOptions(every_s, retake=tuple(retake or ())), known, as_json)
        return
    pictures = Pictures(images, pattern, full_scale(bits))
    run(
        lambda say: put_to_use(folder, calibrate_camera(folder, camera, pictures, target, say)),
        folder,
        known,
        as_json,
    )


def projector(
    experiment: Folder,
    images: Images = None,
    grid: Grid = "",
    square: Square = "",
    projector_px: Annotated[
        str | None, typer.Option(help="The projector's native pixels, such as 1024x768.")
    ] = None,
    pattern: PatternOption = None,
    board: Kind = "chessboard",
    marker: Marker = None,
    dictionary: Dictionary = "DICT_5X5_250",
    view: CameraName = None,
    bits: Bits = None,
    white_first: Annotated[bool, typer.Option(help="White and black come first, not last.")] = False,
    ambient_temperature_k: Ambient = None,
    minutes_on: MinutesOn = None,
    frames: Frames = 1,
    settle_s: Settle = 0.2,
    every_s: Every = None,
    screen: Screen = "kiosk",
    port: Port = 8766,
    retake: Retake = None,
    discard: Discard = False,
    as_json: AsJson = False,
) -> None:
    """Fit camera and projector to Gray-code sequences on a board, one sequence for each place of it."""
    folder = CalibrationFolder(experiment)
    camera = named_view(folder, view)
    if discard:
        folder.discard(StepName.projector, camera)
        return
    target = needed_board(chosen_board(folder, board, grid, square, marker, dictionary))
    known = told(ambient_temperature_k, minutes_on)
    if images is None:
        plan = LivePlan(StepName.projector, camera, target, frames, settle_s=settle_s)
        live(folder, plan, LiveOptions(every_s, screen, port, tuple(retake or ())), known, as_json)
        return
    pictures = Pictures(images, pattern, full_scale(bits), white_first)
    panel = panel_size(folder, camera, projector_px)
    run(
        lambda say: put_to_use(folder, calibrate_projector(folder, camera, pictures, target, panel, say)),
        folder,
        known,
        as_json,
    )


def wall(
    experiment: Folder,
    images: Images = None,
    level_image: Annotated[
        Path | None, typer.Option(help="Picture of a board held level and flat against the wall.")
    ] = None,
    grid: Grid = "",
    square: Square = "",
    pattern: PatternOption = None,
    board: Kind = "chessboard",
    marker: Marker = None,
    dictionary: Dictionary = "DICT_5X5_250",
    anchor: Annotated[
        str | None,
        typer.Option(
            help="A wall point seen at U,V whose room X,Z [m] were measured (of an x wall Y,Z; of a z wall X,Y)."
        ),
    ] = None,
    camera_at: Annotated[
        str | None,
        typer.Option(help="Room X,Z [m] of the camera, of an x wall Y,Z, of a z wall X,Y (the scene's)."),
    ] = None,
    wall_y: Annotated[
        float | None,
        typer.Option(help="The wall's room coordinate [m]: y, of an x wall x, of a z wall z (the scene's)."),
    ] = None,
    plumb_px: Annotated[
        str | None, typer.Option(help="Lower and upper end of a vertical line on the wall: U,V,U,V.")
    ] = None,
    view: CameraName = None,
    bits: Bits = None,
    ambient_temperature_k: Ambient = None,
    minutes_on: MinutesOn = None,
    frames: Frames = 1,
    settle_s: Settle = 0.2,
    every_s: Every = None,
    screen: Screen = "kiosk",
    port: Port = 8766,
    discard: Discard = False,
    as_json: AsJson = False,
) -> None:
    """Find the back wall and place camera and projector in the room: live, or from --images, --level-image."""
    folder = CalibrationFolder(experiment)
    camera = named_view(folder, view)
    if discard:
        folder.discard(StepName.wall, camera)
        return
    target = chosen_board(folder, board, grid, square, marker, dictionary)
    placement = make_placement(folder, camera, anchor, camera_at, wall_y, plumb_px)
    known = told(ambient_temperature_k, minutes_on)
    if images is None and level_image is None:
        plan = LivePlan(StepName.wall, camera, target, frames, settle_s=settle_s, placement=placement)
        live(folder, plan, LiveOptions(every_s, screen, port), known, as_json)
        return
    level = None if level_image is None else (level_image, needed_board(target))
    pictures = None if images is None else Pictures(images, pattern, full_scale(bits))
    run(
        lambda say: put_to_use(folder, calibrate_wall(folder, camera, pictures, level, placement, say)),
        folder,
        known,
        as_json,
    )


def response(
    experiment: Folder,
    images: Annotated[
        Path | None, typer.Option(help="Folder with dark, grey_<level>, exposure_<seconds>; else live.")
    ] = None,
    bits: Annotated[int | None, typer.Option(help="Bits of the camera, for --images.")] = None,
    view: CameraName = None,
    ambient_temperature_k: Ambient = None,
    minutes_on: MinutesOn = None,
    response_frames: Annotated[int, typer.Option(min=2, max=1000, help="Live: frames a burst.")] = 16,
    settle_s: Settle = 0.2,
    every_s: Every = None,
    screen: Screen = "kiosk",
    port: Port = 8766,
    discard: Discard = False,
    as_json: AsJson = False,
) -> None:
    """Measure dark level, gain, read noise, linearity, the projector's curve and the flat field."""
    folder = CalibrationFolder(experiment)
    camera = named_view(folder, view)
    if discard:
        folder.discard(StepName.response, camera)
        return
    known = told(ambient_temperature_k, minutes_on)
    if images is None:
        plan = LivePlan(StepName.response, camera, None, response_frames=response_frames, settle_s=settle_s)
        run_live(experiment, plan, LiveOptions(every_s, screen, port))
        folder.note(conditions_of(folder.settings(), known))
        bundle = folder.bundle()
    else:
        if bits is None:
            raise BadInputError("Give --bits with --images: the bits of the camera that took them.")
        full_scale(bits)
        bundle = calibrate_response(folder, camera, images, bits)
        folder.note(known)
    _echo_response(bundle.of(camera, folder.is_first(camera)), camera, as_json)


def _echo_response(bundle: Bundle, camera: str, as_json: bool) -> None:
    found = bundle.response(camera)
    content = {"camera": encode(found), "projector": encode(bundle.projector_response)}
    if found is None:
        raise AirlensError("The response is not measured yet. What was taken is kept; run the command again.")
    if as_json:
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


def page(experiment: Folder, view: CameraName = None) -> None:
    """Write the calibration's figures and advice as one HTML file."""
    folder = CalibrationFolder(experiment)
    typer.echo(write_page(folder, named_view(folder, view)))


def live(
    folder: CalibrationFolder, plan: LivePlan, options: LiveOptions, known: Conditions, as_json: bool
) -> None:
    """Guide through a step on the rig, then print what it came to."""
    known = conditions_of(folder.settings(), known)

    def step(say: Callable[[str], None]) -> StepOutcome:
        run_live(folder.experiment, plan, options)
        record = folder.collected(plan.camera)
        if record is None:
            raise AirlensError("No view shows the board yet. Run the command again; it goes on from here.")
        return modelled(folder, plan.step, record, [])

    run(step, folder, known, as_json)


def from_pictures(
    step: Callable[[Callable[[str], None]], StepOutcome],
    folder: CalibrationFolder,
    known: Conditions,
    as_json: bool,
) -> None:
    """Do a step on pictures that are there; what they suffice for is in use at once."""
    run(lambda say: put_to_use(folder, step(say)), folder, known, as_json)


def run(
    step: Callable[[Callable[[str], None]], StepOutcome],
    folder: CalibrationFolder,
    known: Conditions,
    as_json: bool,
) -> None:
    """Do a step, show its progress on standard error, print its outcome; exit status 1 if incomplete."""
    began = time.perf_counter()

    def say(name: str) -> None:
        if sys.stderr.isatty():
            typer.echo(f"reading {name}", err=True)

    try:
        done = step(say)
    except CalibrationError as error:
        raise BadInputError(str(error)) from error
    started = folder.started(done.record.camera)
    if started is None:
        folder.note(known)
    content: dict[str, Any] = summary(done, time.perf_counter() - began)
    typer.echo(json.dumps(content, indent=1) if as_json else "\n".join(lines(content)))
    if started is not None:
        raise AirlensError(
            f"The step '{started}' is not complete; the calibration in use is as it was. What was found is "
            "kept: add the pictures that are still wanted, or forget them with --discard."
        )
