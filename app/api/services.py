"""What the routes work with: built once per service, handed to routes by FastAPI, never global."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from app.api.access import Access
from app.api.settings import ServiceConfig
from app.uploads.store import UploadStore


@dataclass(frozen=True)
class Services:
    """Everything that a route may use."""

    config: ServiceConfig
    access: Access
    uploads: UploadStore


def services_of(connection: HTTPConnection) -> Services:
    """Return the services of the app that serves `connection`."""
    return connection.app.state.services


Given = Annotated[Services, Depends(services_of)]
