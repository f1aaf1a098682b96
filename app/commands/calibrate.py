"""`airlens calibrate`: its steps by name; they are imported when one is run."""

import typer

from app.commands.lazy import lazy_group

_MODULE = "app.commands.calibrate_steps"
STEPS = {
    "camera": (
        _MODULE,
        "Fit the camera to views of a board: live, or in pictures (of a Gray-code sequence, its white frame).",
    ),
    "projector": (
        _MODULE,
        "Fit camera and projector to Gray-code sequences on a board, one sequence for each place of it.",
    ),
    "wall": (
        _MODULE,
        "Find the back wall and place camera and projector in the room: live, or from --images, --level-image.",
    ),
    "response": (
        _MODULE,
        "Measure dark level, gain, read noise, linearity, the projector's curve and the flat field.",
    ),
    "together": (
        "app.commands.calibrate_together",
        "Adjust several views together, by a board that their cameras see at the same time: live, or in pictures.",
    ),
    "drift": (
        _MODULE,
        "Measure what moved between two exposures: camera and, with printed marks, projector apart.",
    ),
    "page": (_MODULE, "Write the calibration's figures and advice as one HTML file."),
}


def register(cli: typer.Typer) -> None:
    """Add `calibrate` and its subcommands."""
    calibrate = typer.Typer(
        cls=lazy_group(STEPS),
        no_args_is_help=True,
        help="Calibrate camera, projector, wall and response: live on the experiment's rig, guided, or from "
        "--images. What is found is kept; the same command goes on.",
    )

    @calibrate.callback()
    def _calibrate() -> None: ...

    cli.add_typer(calibrate, name="calibrate")
