"""The kiosk page: routes that show a picture on a browser's screen and take its report.

    app.include_router(create_kiosk_router(screen), prefix="/kiosk")      then open /kiosk/page

The page asks for no data but the picture, and runs no script but its own file.
"""

from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, FastAPI, HTTPException
from pydantic import Field
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import FileResponse, Response

from app.files.toml import Strict
from app.kiosk.screen import KioskScreen, ScreenReport

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


def create_kiosk_router(screen: KioskScreen) -> APIRouter:
    """Return the routes of the page and its data, for one screen."""
    router = APIRouter(tags=["kiosk"])
    for name, (file, media) in _FILES.items():
        router.add_api_route(f"/{name}", _file(file, media), include_in_schema=False, methods=["GET"])

    @router.get("/frame")
    def frame() -> FrameAnswer:
        digest, picture = screen.current
        rows, cols = (0, 0) if picture is None else picture.shape
        return FrameAnswer(id=digest, width_px=cols, height_px=rows)

    @router.get("/frames/{digest}")
    def pixels(digest: str) -> Response:
        current, picture = screen.current
        if picture is None or digest != current:
            raise HTTPException(404, "That picture is not shown any more. Ask which one is.")
        return Response(picture.tobytes(), media_type="application/octet-stream")

    @router.post("/report", status_code=204)
    def report(body: ReportBody) -> None:
        screen.take_report(ScreenReport(**body.model_dump()))

    return router


def create_kiosk_app(screen: KioskScreen) -> FastAPI:
    """Return a small service with nothing but the page, for the loopback address."""
    app = FastAPI(title="airlens kiosk", openapi_url=None, docs_url=None, redoc_url=None)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=["127.0.0.1", "localhost"])
    app.include_router(create_kiosk_router(screen), prefix="/kiosk")
    return app


def _file(name: str, media: str):
    def serve() -> Response:
        headers = {"content-security-policy": POLICY, "cache-control": "no-cache"}
        return FileResponse(FOLDER / name, media_type=media, headers=headers)

    return serve
