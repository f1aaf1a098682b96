"""What a projector's own page (its kiosk) shows: which pattern, and whether it is there pixel for pixel."""

from typing import Annotated

import cv2
from fastapi import APIRouter, Query, Response

from app.api.models.screen import ScreenResource, ShowPattern, State
from app.api.resources.projector import ViewNumber, lamp_of
from app.api.services import Given, Services
from app.api.wire.bodies import body
from app.api.wire.identifier import Identifier
from app.kiosk.screen import KioskScreen
from app.kiosk.screens import page_of
from app.rig.patterns import PatternName, pattern_picture
from drivers.display import Picture

router = APIRouter(tags=["devices"])
PICTURE = body("image/png", "The pattern, made smaller for the eyes.")


@router.get("/devices/screen")
def read_screen(given: Given, view: ViewNumber = 0) -> ScreenResource:
    """Return what the kiosk page of a projector last said."""
    return _resource(given, view)


@router.put("/devices/screen")
def show_pattern(given: Given, wanted: ShowPattern) -> ScreenResource:
    """Put a pattern on the kiosk page of a view's projector; it is there as soon as `state` is `showing`."""
    experiment = given.folders.open(wanted.experiment)
    number = lamp_of(experiment, wanted.view)
    given.screens.of(number).put(pattern_picture(experiment, wanted.pattern, number))
    return _resource(given, number)


@router.delete("/devices/screen")
def clear_screen(given: Given, view: ViewNumber = 0) -> ScreenResource:
    """Take the pattern away."""
    given.screens.of(view).close()
    return _resource(given, view)


@router.get("/experiments/{experiment}/patterns/{pattern}", response_class=Response, responses=PICTURE)
def preview_pattern(
    given: Given,
    experiment: Identifier,
    pattern: PatternName,
    width: Annotated[int, Query(ge=16, le=4096, description="At most so many columns.")] = 480,
    view: ViewNumber = 0,
) -> Response:
    """Return a pattern of a view's projector as a small picture."""
    found = given.folders.open(experiment)
    picture = pattern_picture(found, pattern, lamp_of(found, view))
    return Response(_small_png(picture, width), media_type="image/png")


def _small_png(picture: Picture, width: int) -> bytes:
    rows, cols = picture.shape
    shown = min(width, cols)
    size = (shown, max(1, round(rows * shown / cols)))
    done, encoded = cv2.imencode(".png", cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    return encoded.tobytes() if done else b""


def _resource(given: Services, view: int) -> ScreenResource:
    screen = given.screens.of(view)
    digest, size_px = screen.wanted
    state, reason = _state(screen, digest)
    cols, rows = size_px or (None, None)
    return ScreenResource(
        view=view,
        state=state,
        width_px=cols,
        height_px=rows,
        digest=digest,
        reason=reason,
        page=page_of(view),
    )


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
