"""A service without limits of rate, for benchmarks that ask faster than anybody may."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fastapi import FastAPI

from app.api.factory import create_app
from app.api.security.settings import Limits, new_token, service_config
from app.api.server import listen, serving


@dataclass(frozen=True)
class Served:
    """A service that runs."""

    app: FastAPI
    url: str
    token: str

    @property
    def headers(self) -> dict[str, str]:
        """What a request must say."""
        return {"Authorization": f"Bearer {self.token}"}


@contextmanager
def unlimited(root: Path) -> Iterator[Served]:
    """Serve a data folder."""
    bound, token = listen("127.0.0.1", 0), new_token()
    limits = Limits(reads_per_s=1e9, writes_per_s=1e9, failures_per_s=1e9)
    app = create_app(service_config(root, token, bound.getsockname()[1], limits=limits))
    with serving(app, bound) as port:
        yield Served(app, f"http://127.0.0.1:{port}", token)
