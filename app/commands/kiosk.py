"""`airlens kiosk`: show a picture on a projector through a browser, pixel for pixel; of several, on each its own."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from drivers.display import Picture


def register(cli: typer.Typer) -> None:
    """Add `kiosk`."""
    cli.command()(kiosk)


def kiosk(
    shown: Annotated[
        Path | None,
        typer.Argument(
            metavar="PICTURE|EXPERIMENT",
            help="Grey picture of the native size; or an experiment, each of whose projectors shows its own pattern.",
        ),
    ] = None,
    identify: Annotated[str | None, typer.Option(help="Show the identify frame of WIDTHxHEIGHT.")] = None,
    view: Annotated[
        str | None, typer.Option(help="Of an experiment: only the projector that lights this view.")
    ] = None,
    pattern: Annotated[
        str, typer.Option(help="Of an experiment: scene, identify, focus, white, grey or black.")
    ] = "scene",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 for any.")] = 8642,
    screen: Annotated[str, typer.Option(help="kiosk, or a card without desktop: /dev/dri/card0.")] = "kiosk",
    wait: Annotated[float, typer.Option(min=1.0, help="Give up after so many seconds.")] = 300.0,
    once: Annotated[bool, typer.Option("--once", help="End when everything is on screen.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show pictures on projectors by pages in their browsers, or by a card, and say when they are there.

    Open each printed address on its projector, full screen: chromium --kiosk ADDRESS. Move the pointer over
    the page once, so that it hides.
    """
    import time

    from app.capture.burst import interruptible
    from app.rig.screens import open_screens

    whose, pictures = _pictures(shown, identify, view, pattern)

    def say(text: str) -> None:
        typer.echo(json.dumps({"address": text.split()[1]}) if as_json else text)

    def told(number: int, digest: str) -> None:
        rows, cols = pictures[number].shape
        size = {"digest": digest, "width_px": cols, "height_px": rows}
        on = f", of {whose[number]!r}" if whose[number] else ""
        text = f"On screen, pixel for pixel{on}: {cols} x {rows}, sha256 {digest}"
        typer.echo(json.dumps(size | ({"view": whose[number]} if on else {})) if as_json else text)

    with open_screens(screen, whose, port, say, wait) as displays, interruptible() as stopped:
        for number, display in displays.items():
            put = getattr(display, "put", None)
            if put is not None:  # pages draw side by side
                put(pictures[number])
        for number, display in displays.items():
            told(number, display.show(pictures[number]))
        while not once and not stopped():
            time.sleep(0.1)


def _pictures(
    shown: Path | None, identify: str | None, view: str | None, pattern: str
) -> "tuple[dict[int, str], dict[int, Picture]]":
    """By their projectors' numbers whose they are, where there are several, and the pictures."""
    from typing import get_args

    from app.errors import BadInputError
    from app.experiment.folder import open_experiment
    from app.experiment.views import chosen_projectors
    from app.rig.patterns import PatternName, pattern_picture

    if shown is None or not shown.is_dir():
        if view is not None:
            raise BadInputError("--view says which projector of an experiment: give the experiment's folder.")
        return {0: ""}, {0: _picture(shown, identify)}
    if identify is not None:
        raise BadInputError("Give an experiment, or --identify WIDTHxHEIGHT; one of the two.")
    known = {name: name for name in get_args(PatternName)}
    if pattern not in known:
        raise BadInputError(f"--pattern {pattern!r} is not known; expected one of {', '.join(known)}.")
    experiment = open_experiment(shown)
    whose = chosen_projectors(experiment, view)
    return whose, {number: pattern_picture(experiment, known[pattern], number) for number in whose}


def _picture(path: Path | None, identify: str | None):
    import cv2
    import numpy as np

    from app.errors import BadInputError
    from drivers.identify import identify_frame

    if (path is None) == (identify is None):
        raise BadInputError("Give a picture, an experiment, or --identify WIDTHxHEIGHT; one of them.")
    if identify is not None:
        width, cross, height = identify.partition("x")
        if not (cross and width.isdigit() and height.isdigit()):
            raise BadInputError(f"--identify {identify!r} is no size; expected WIDTHxHEIGHT, as 1920x1080.")
        return identify_frame(int(height), int(width))
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 2 or image.dtype != np.uint8:
        raise BadInputError(f"{path} is not a grey picture of 8 bit. Save it as a grey PNG.")
    return np.asarray(image, np.uint8)
