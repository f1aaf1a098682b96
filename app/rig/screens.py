"""The projector's screen for the command line: a page in a browser, or a graphics card without a desktop."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

from app.kiosk.screen import KioskScreen
from app.kiosk.server import serve_kiosk
from drivers.display import PatternDisplay
from drivers.drm import DrmDisplay


@contextlib.contextmanager
def open_screen(
    screen: str, port: int, say: Callable[[str], object], wait_s: float = 120.0
) -> Iterator[PatternDisplay]:
    """`kiosk`: a page that is served and opened on the projector; else a card, such as /dev/dri/card0.

    Raises DeviceError for a card that is away or has a desktop, AirlensError for a port that is taken.
    """
    if screen != "kiosk":
        with DrmDisplay(Path(screen)) as display:
            yield display
        return
    kiosk = KioskScreen(timeout_s=wait_s)
    with serve_kiosk(kiosk, port) as address:
        say(f"Open {address} on the projector, full screen: chromium --kiosk {address}")
        yield kiosk
