"""A real service on a free port, one for a module, and its client."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import httpx
import pytest
from fastapi import FastAPI

from app.api.factory import create_app
from app.api.security.settings import ServiceConfig, new_token, service_config
from app.api.server import listen, serving
from app.client import Client


class Running(Protocol):
    """What the service tells of work that it does."""

    state: Any


R = TypeVar("R", bound=Running)


@dataclass(frozen=True)
class Live:
    app: FastAPI
    config: ServiceConfig
    port: int
    token: str

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def bearer(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.token}"}

    def client(self) -> httpx.Client:
        return httpx.Client(base_url=self.url, headers=self.bearer, timeout=100)


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    root: Path = tmp_path_factory.mktemp("data")
    bound = listen("127.0.0.1", 0)
    port, token = bound.getsockname()[1], new_token()
    config = service_config(root, token, port)
    app = create_app(config)
    with serving(app, bound):
        yield Live(app, config, port, token)


@pytest.fixture(scope="module")
def airlens(live: Live) -> Iterator[Client]:
    with Client(live.url, live.token, timeout_s=200) as client:
        yield client


def finished(ask: Callable[[], R], limit_s: float = 200.0) -> R:
    """What `ask` answers once it runs no more."""
    until_s = time.monotonic() + limit_s
    while (found := ask()).state == "running":
        assert time.monotonic() < until_s, found
        time.sleep(0.02)
    return found


def is_problem(response: httpx.Response, code: str) -> bool:
    """Whether an answer has the one error shape with `code`, and repeats its status."""
    content = response.json()
    needed = {"type", "title", "status", "code", "detail", "cause", "next_step"}
    return (
        response.headers["content-type"] == "application/problem+json"
        and needed <= content.keys()
        and content["code"] == code
        and content["status"] == response.status_code
        and content["next_step"] in content["detail"]
    )
