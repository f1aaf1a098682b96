"""The kiosk pages: routes that show a picture on a browser's screen and take its report, for each projector its own.

    app.include_router(create_kiosk_router(screens), prefix="/kiosk")     then open /kiosk/page, /kiosk/1/page

A page asks for no data but the picture, and runs no script but its own file.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends, FastAPI, HTTPException
from fastapi import Path as PathPart
from pydantic import Field
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import FileResponse, Response

from app.files.toml import Strict
from app.kiosk.screen import KioskScreen, ScreenReport
from app.kiosk.screens import MOST, KioskScreens

FOLDER = Path(__file__).parent / "page"
POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; frame-ancestors 'none'"
_FILES = {"page": ("kiosk.html", "text/html"), "kiosk.js": ("kiosk.js", "text/javascript")}
_FILES["kiosk.css"] = ("kiosk.css", "text/css")


Text = Annotated[str, Field(max_length=1000)]
Pixels = Annotated[int, Field(ge=0, le=1_000_000)]


class FrameAnswer(Strict):
    """The picture that shall be shown; no id means none."""

    id: str
    width_px: int
    height_px: int


class ReportBody(Strict):
    """The page's report; see `ScreenReport`."""

    id: Text
    digest: Text
    reason: Text
    width_px: Pixels
    height_px: Pixels
    device_pixel_ratio: Annotated[float, Field(ge=0, le=1000)]


def create_kiosk_router(screens: KioskScreens) -> APIRouter:
    """Return the routes of all screens: those of the first projector, and below its number those of each."""
    router = APIRouter(tags=["kiosk"])

    def first() -> KioskScreen:
        return screens.of(0)

    def numbered(number: Annotated[int, PathPart(ge=0, lt=MOST)]) -> KioskScreen:
        return screens.of(number)

    _add_routes(router, first)
    own = APIRouter(prefix="/{number}")
    _add_routes(own, numbered)
    router.include_router(own)
    return router


def _add_routes(router: APIRouter, screen_of: Callable[..., KioskScreen]) -> None:
    for name, (file, media) in _FILES.items():
        router.add_api_route(f"/{name}", _file(file, media), include_in_schema=False, methods=["GET"])

    @router.get("/frame")
    def frame(screen: Annotated[KioskScreen, Depends(screen_of)]) -> FrameAnswer:
        digest, picture = screen.current
        rows, cols = (0, 0) if picture is None else picture.shape
        return FrameAnswer(id=digest, width_px=cols, height_px=rows)

    @router.get("/frames/{digest}")
    def pixels(digest: str, screen: Annotated[KioskScreen, Depends(screen_of)]) -> Response:
        current, picture = screen.current
        if picture is None or digest != current:
            raise HTTPException(404, "That picture is not shown any more. Ask which one is.")
        return Response(picture.tobytes(), media_type="application/octet-stream")

    @router.post("/report", status_code=204)
    def report(body: ReportBody, screen: Annotated[KioskScreen, Depends(screen_of)]) -> None:
        screen.take_report(ScreenReport(**body.model_dump()))


def create_kiosk_app(screens: KioskScreens) -> FastAPI:
    """Return a small service with nothing but the pages, for the loopback address."""
    app = FastAPI(title="airlens kiosk", openapi_url=None, docs_url=None, redoc_url=None)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=["127.0.0.1", "localhost"])
    app.include_router(create_kiosk_router(screens), prefix="/kiosk")
    return app


def _file(name: str, media: str):
    def serve() -> Response:
        headers = {"content-security-policy": POLICY, "cache-control": "no-cache"}
        return FileResponse(FOLDER / name, media_type=media, headers=headers)

    return serve
