"""What the projector's own page (the kiosk) shows: which pattern, and whether it is there pixel for pixel."""

from typing import Annotated

import cv2
from fastapi import APIRouter, Query, Response

from app.api.models.screen import ScreenResource, ShowPattern, State
from app.api.services import Given, Services
from app.api.wire.bodies import body
from app.api.wire.identifier import Identifier
from app.kiosk.screen import KioskScreen
from app.rig.patterns import PatternName, pattern_picture
from drivers.display import Picture

router = APIRouter(tags=["devices"])
PICTURE = body("image/png", "The pattern, made smaller for the eyes.")


@router.get("/devices/screen")
def read_screen(given: Given) -> ScreenResource:
    """Return what the kiosk page last said."""
    return _resource(given)


@router.put("/devices/screen")
def show_pattern(given: Given, wanted: ShowPattern) -> ScreenResource:
    """Put a pattern on the kiosk page; it is there as soon as `state` is `showing`."""
    given.screen.put(pattern_picture(given.folders.open(wanted.experiment), wanted.pattern))
    return _resource(given)


@router.delete("/devices/screen")
def clear_screen(given: Given) -> ScreenResource:
    """Take the pattern away."""
    given.screen.close()
    return _resource(given)


@router.get("/experiments/{experiment}/patterns/{pattern}", response_class=Response, responses=PICTURE)
def preview_pattern(
    given: Given,
    experiment: Identifier,
    pattern: PatternName,
    width: Annotated[int, Query(ge=16, le=4096, description="At most so many columns.")] = 480,
) -> Response:
    """Return a pattern as a small picture."""
    picture = pattern_picture(given.folders.open(experiment), pattern)
    return Response(_small_png(picture, width), media_type="image/png")


def _small_png(picture: Picture, width: int) -> bytes:
    rows, cols = picture.shape
    shown = min(width, cols)
    size = (shown, max(1, round(rows * shown / cols)))
    done, encoded = cv2.imencode(".png", cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    return encoded.tobytes() if done else b""


def _resource(given: Services) -> ScreenResource:
    screen = given.screen
    digest, size_px = screen.wanted
    state, reason = _state(screen, digest)
    cols, rows = size_px or (None, None)
    return ScreenResource(state=state, width_px=cols, height_px=rows, digest=digest, reason=reason)


def _state(screen: KioskScreen, digest: str) -> tuple[State, str]:
    report = screen.report
    if not digest:
        return "empty", ""
    if not screen.is_alive:
        away = "No kiosk page answers. Open it on the projector, full screen."
        return ("away" if report else "waiting"), away
    if report is None:
        return "waiting", ""
    if report.reason or report.digest != digest:
        other = "The page drew other pixels than were sent. Switch its colour management off."
        return "refused", report.reason or other
    return "showing", ""
