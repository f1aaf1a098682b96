"""A real service on a free port, one for a module."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from app.api.factory import create_app
from app.api.security.settings import ServiceConfig, new_token, service_config
from app.api.server import listen, serving


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
