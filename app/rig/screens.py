"""The projector's screen for the command line: a page in a browser, or a graphics card without a desktop."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from app.errors import BadInputError
from app.kiosk.screens import KioskScreens, page_of
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
    with open_pages({0: ""}, port, say, wait_s) as displays:
        yield displays[0]


@contextlib.contextmanager
def open_screens(
    screen: str, projectors: Mapping[int, str], port: int, say: Callable[[str], object], wait_s: float = 120.0
) -> Iterator[Mapping[int, PatternDisplay]]:
    """As `open_screen`, for each projector by its number; the name says whose it is, where there are several.

    Raises BadInputError for a card and several projectors.
    """
    if screen == "kiosk":
        with open_pages(projectors, port, say, wait_s) as pages:
            yield pages
        return
    if len(projectors) > 1:
        named = ", ".join(repr(name) for name in projectors.values())
        raise BadInputError(
            f"A card shows one picture, and there are the projectors of {named}. Give --view."
        )
    with open_screen(screen, port, say, wait_s) as display:
        yield dict.fromkeys(projectors, display)


@contextlib.contextmanager
def open_pages(
    projectors: Mapping[int, str], port: int, say: Callable[[str], object], wait_s: float = 120.0
) -> Iterator[dict[int, PatternDisplay]]:
    """A page for each projector, by its number; the name says whose it is, where there are several.

    Raises AirlensError for a port that is taken.
    """
    kiosks = KioskScreens(timeout_s=wait_s)
    with serve_kiosk(kiosks, port) as address:
        for number, name in projectors.items():
            page, whose = f"{address}{page_of(number)}", f" of {name!r}" if name else ""
            say(f"Open {page} on the projector{whose}, full screen: chromium --kiosk {page}")
        yield {number: kiosks.of(number) for number in projectors}
