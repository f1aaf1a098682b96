"""`create_app(config)`: the service as one ASGI app, guarded as a whole."""

import contextlib
from collections.abc import AsyncIterator

from fastapi import APIRouter, FastAPI
from starlette.middleware import Middleware

from app.api.page import add_page
from app.api.resources import (
    about,
    addresses,
    answers,
    calibrations,
    captures,
    devices,
    events,
    experiments,
    guide,
    jobs,
    live,
    plans,
    prints,
    projector,
    results,
    screen,
    shift,
    together,
    uploads,
)
from app.api.security import session
from app.api.security.audit import AuditLog
from app.api.security.guard import Guard
from app.api.security.settings import ServiceConfig
from app.api.services import create_services
from app.api.wire.description import describe
from app.api.wire.handlers import add_handlers
from app.kiosk.routes import create_kiosk_router

RESOURCES: tuple[APIRouter, ...] = (
    about.router,
    session.router,
    devices.router,
    projector.router,
    screen.router,
    shift.router,
    experiments.router,
    addresses.router,
    answers.router,
    calibrations.router,
    guide.router,
    together.router,
    live.router,
    captures.router,
    plans.router,
    prints.router,
    results.router,
    jobs.router,
    events.router,
    uploads.router,
)


def create_app(config: ServiceConfig) -> FastAPI:
    """Build the service. Its data stay in `config.data_root`; two apps share nothing else."""
    services = create_services(config)
    audit = AuditLog(config.data_root / "service" / "audit.jsonl")

    @contextlib.asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        yield
        services.guide.close()
        services.desk.close()
        services.beside.close()
        services.cameras.close()
        services.projectors.close()

    app = FastAPI(
        title="airlens",
        version=about.version(),
        summary="See and measure the air in a room.",
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        lifespan=lifespan,
        # Outermost but for the catcher of unforeseen errors, which shows no data.
        middleware=[Middleware(Guard, access=services.access, limits=config.limits, audit=audit)],
    )
    app.state.services = services
    add_handlers(app)
    for router in RESOURCES:
        app.include_router(router, prefix="/api")
    # The projector's browser: same origin, same session, nothing but the picture.
    app.include_router(create_kiosk_router(services.screens), prefix="/kiosk", include_in_schema=False)
    add_page(app, config.page_folder)
    describe(app)
    return app
