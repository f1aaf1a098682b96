"""The operator's page: the built files of `web/`, or a page that says how to build them."""

from pathlib import Path

from fastapi import FastAPI
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, Response

from app.api.wire.problems import ApiError

MEDIA_TYPES = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".woff2": "font/woff2"}
NOT_BUILT = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>airlens</title></head>
<body><h1>The page is not built</h1><p>The service runs; its page was not built on this machine, because
npm could not run when airlens was installed. Build it with <code>python web/hatch_build.py</code> in the
source folder, then load this page again. The command line and the API work without it.</p></body></html>
"""


def add_page(app: FastAPI, folder: Path) -> None:
    """Serve the page at `/` and its hashed files under `/assets`."""

    async def index(_request: Request) -> Response:
        built = folder / "index.html"
        return FileResponse(built) if built.is_file() else HTMLResponse(NOT_BUILT)

    async def icon(_request: Request) -> Response:
        built = folder / "favicon.svg"
        return (
            FileResponse(built, media_type="image/svg+xml") if built.is_file() else Response(status_code=204)
        )

    async def asset(request: Request) -> Response:
        # Found by listing: no path is made from what was asked.
        wanted = request.path_params["name"]
        found = next((path for path in (folder / "assets").glob("*") if path.name == wanted), None)
        if found is None:
            raise ApiError("not_found", "The page has no such file.", "Load the page again.")
        return FileResponse(found, media_type=MEDIA_TYPES.get(found.suffix, "application/octet-stream"))

    app.add_route("/", index, include_in_schema=False)
    app.add_route("/index.html", index, include_in_schema=False)
    app.add_route("/favicon.svg", icon, include_in_schema=False)
    app.add_route("/assets/{name}", asset, include_in_schema=False)
