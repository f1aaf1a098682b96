"""What the Ray engine refuses, against a small HTTP server on the loopback. The real head: tests/cluster."""

import contextlib
import http.server
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.jobs.config import RayConfig
from app.jobs.engines.ray import RayEngine
from app.jobs.errors import EngineError


class OpenHead(http.server.BaseHTTPRequestHandler):
    """Answers everybody, as a Ray head does that was started without a token."""

    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"[]")

    def log_message(self, *_):
        pass


@pytest.fixture
def open_head() -> Iterator[str]:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), OpenHead) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


def test_a_head_that_answers_without_a_token_is_refused(open_head: str, tmp_path: Path):
    (tmp_path / "token").write_text("secret")
    engine = RayEngine(RayConfig(address=open_head, token_file=str(tmp_path / "token")))
    refused = "answered 200 to a request without a token; 401 was expected"
    with contextlib.closing(engine), pytest.raises(EngineError, match=refused):
        engine.probe()


def test_a_missing_token_file_is_named(open_head: str, tmp_path: Path):
    engine = RayEngine(RayConfig(address=open_head, token_file=str(tmp_path / "nothing")))
    with contextlib.closing(engine), pytest.raises(EngineError, match="nothing"):
        engine.state("any")
