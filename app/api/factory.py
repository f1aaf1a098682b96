"""`create_app(config)`: the service as one ASGI app, guarded as a whole."""

from fastapi import APIRouter, FastAPI
from starlette.middleware import Middleware
from starlette.types import ASGIApp

from app.api import about, session, uploads
from app.api.access import Access
from app.api.audit import AuditLog
from app.api.description import describe
from app.api.guard import Guard
from app.api.handlers import add_handlers
from app.api.page import add_page
from app.api.services import Services
from app.api.settings import ServiceConfig
from app.uploads.store import UploadLimits, UploadStore

RESOURCES: tuple[APIRouter, ...] = (about.router, session.router, uploads.router)


def create_app(config: ServiceConfig) -> FastAPI:
    """Build the service. Its data stay in `config.data_root`; two apps share nothing else."""
    access = Access(config)
    audit = AuditLog(config.data_root / "service" / "audit.jsonl")
    app = FastAPI(
        title="airlens",
        version=about.version(),
        summary="See and measure the air in a room.",
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        # Middleware is outermost but for the catcher of unforeseen errors, which shows no data.
        middleware=[Middleware(_guarded(access, config, audit))],
    )
    app.state.services = Services(
        config, access, UploadStore(config.data_root / "uploads", _upload_limits(config))
    )
    add_handlers(app)
    for router in RESOURCES:
        app.include_router(router, prefix="/api")
    add_page(app, config.page_folder)
    describe(app)
    return app


def _guarded(access: Access, config: ServiceConfig, audit: AuditLog):
    def guard(app: ASGIApp) -> Guard:
        return Guard(app, access, config.limits, audit)

    return guard


def _upload_limits(config: ServiceConfig) -> UploadLimits:
    limits = config.limits
    return UploadLimits(
        pixels=limits.image_pixels,
        unpacked_bytes=limits.unpacked_bytes,
        parse_s=limits.parse_s,
        parse_memory_bytes=limits.parse_memory_bytes,
        stored=limits.stored_uploads,
    )
