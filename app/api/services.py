"""What the routes work with: built once per service, handed to routes by FastAPI, never global."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from app.api.folders import Folders
from app.api.security.access import Access
from app.api.security.confirmed import Confirmed
from app.api.security.settings import ServiceConfig
from app.api.wire.curves import CurveCache
from app.api.wire.feed import EventFeed
from app.api.wire.volumes import SolutionCache
from app.calibrate.service import CalibrationDesk
from app.calibrate.together_service import TogetherDesk
from app.capture.service import CaptureDesk
from app.files.uploads.store import UploadLimits, UploadStore
from app.jobs import Ledger
from app.jobs.news import News
from app.jobs.state import ACTIVE
from app.kiosk.screens import KioskScreens
from app.live.beside import LiveAir
from app.rig.live_camera import LiveCamera
from app.rig.live_cameras import LiveCameras
from app.rig.live_projector import LiveProjector
from app.rig.live_projectors import LiveProjectors


@dataclass(frozen=True)
class Services:
    """Everything that a route may use."""

    config: ServiceConfig
    access: Access
    uploads: UploadStore
    folders: Folders
    confirmed: Confirmed
    ledger: Ledger
    feed: EventFeed
    curves: CurveCache
    solutions: SolutionCache
    cameras: LiveCameras
    desk: CaptureDesk
    beside: LiveAir
    guide: CalibrationDesk
    together: TogetherDesk
    screens: KioskScreens
    projectors: LiveProjectors

    @property
    def camera(self) -> LiveCamera:
        """The camera of the first view."""
        return self.cameras.first

    @property
    def projector(self) -> LiveProjector:
        """The projector of the first view."""
        return self.projectors.first


def create_services(config: ServiceConfig) -> Services:
    """Build the services of one configuration."""
    limits = config.limits
    uploads = UploadLimits(
        pixels=limits.image_pixels,
        unpacked_bytes=limits.unpacked_bytes,
        parse_s=limits.parse_s,
        parse_memory_bytes=limits.parse_memory_bytes,
        stored=limits.stored_uploads,
    )
    ledger = Ledger(config.jobs_folder)
    news = News(ledger)
    cameras = LiveCameras(news.tell, busy=lambda: bool(ledger.jobs(states=ACTIVE, limit=1)))
    projectors = LiveProjectors(news.tell)
    beside = LiveAir(news.tell)
    screens = KioskScreens()
    guide = CalibrationDesk(cameras, screens.of, news.tell, projectors)
    return Services(
        config,
        Access(config),
        UploadStore(config.data_root / "uploads", uploads),
        Folders(config.data_root),
        Confirmed(config.data_root / "service" / "confirmed.json"),
        ledger,
        EventFeed(ledger, news.catch_up),
        CurveCache(ledger),
        SolutionCache(),
        cameras,
        CaptureDesk(cameras, news.tell, beside=beside, projectors=projectors),
        beside,
        guide,
        TogetherDesk(cameras, guide, news.tell),
        screens,
        projectors,
    )


def services_of(connection: HTTPConnection) -> Services:
    """Return the services of the app that serves `connection`."""
    return connection.app.state.services


Given = Annotated[Services, Depends(services_of)]
