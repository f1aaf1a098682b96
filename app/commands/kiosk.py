"""`airlens kiosk`: show a picture on the projector through a browser, pixel for pixel."""

import json
from pathlib import Path
from typing import Annotated

import typer


def register(cli: typer.Typer) -> None:
    """Add `kiosk`."""
    cli.command()(kiosk)


def kiosk(
    picture: Annotated[Path | None, typer.Argument(help="Grey picture of the native size.")] = None,
    identify: Annotated[str | None, typer.Option(help="Show the identify frame of WIDTHxHEIGHT.")] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 for any.")] = 8642,
    screen: Annotated[str, typer.Option(help="kiosk, or a card without desktop: /dev/dri/card0.")] = "kiosk",
    wait: Annotated[float, typer.Option(min=1.0, help="Give up after so many seconds.")] = 300.0,
    once: Annotated[bool, typer.Option("--once", help="End when the picture is on screen.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show a picture on the projector by a page in its browser, or by a card, and say when it is there.

    Open the printed address on the projector, full screen: chromium --kiosk ADDRESS. Move the pointer over
    the page once, so that it hides.
    """
    import time

    from app.capture.burst import interruptible
    from app.rig.screens import open_screen

    shown = _picture(picture, identify)
    rows, cols = shown.shape

    def say(text: str) -> None:
        typer.echo(json.dumps({"address": text.split()[1]}) if as_json else text)

    with open_screen(screen, port, say, wait) as display, interruptible() as stopped:
        digest = display.show(shown)
        text = f"On screen, pixel for pixel: {cols} x {rows}, sha256 {digest}"
        typer.echo(json.dumps({"digest": digest, "width_px": cols, "height_px": rows}) if as_json else text)
        while not once and not stopped():
            time.sleep(0.1)


def _picture(path: Path | None, identify: str | None):
    import cv2
    import numpy as np

    from app.errors import BadInputError
    from drivers.identify import identify_frame

    if (path is None) == (identify is None):
        raise BadInputError("Give a picture, or --identify WIDTHxHEIGHT; one of the two.")
    if identify is not None:
        width, cross, height = identify.partition("x")
        if not (cross and width.isdigit() and height.isdigit()):
            raise BadInputError(f"--identify {identify!r} is no size; expected WIDTHxHEIGHT, as 1920x1080.")
        return identify_frame(int(height), int(width))
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 2 or image.dtype != np.uint8:
        raise BadInputError(f"{path} is not a grey picture of 8 bit. Save it as a grey PNG.")
    return np.asarray(image, np.uint8)
