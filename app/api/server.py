"""Runs the service on one address: in this thread for `airlens serve`, in another for tests and notebooks."""

import contextlib
import functools
import socket
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

import uvicorn
from fastapi import FastAPI

from app.api.connections import Gate, PatientProtocol
from app.errors import AirlensError

SWITCH_S = 0.001
BACKLOG = 128


@dataclass(frozen=True)
class Tls:
    """Files of a certificate and its key."""

    certificate: str
    key: str


def listen(host: str, port: int) -> socket.socket:
    """Return a bound socket (`port` 0 finds a free one). Raises AirlensError when the address is taken."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
        # From here on callers wait instead of being refused, however long the start takes.
        bound.listen(BACKLOG)
    except OSError as error:
        bound.close()
        raise AirlensError(
            f"The address {host}:{port} cannot be used ({error.strerror}). Another service may run there; "
            "give another --port, or 0 for a free one."
        ) from error
    return bound


def server_of(app: FastAPI, tls: Tls | None = None) -> uvicorn.Server:
    """Return a server that says nothing of itself and logs no addresses with queries."""
    # Reads wait for the camera's thread at most so long; the default is five times that.
    sys.setswitchinterval(SWITCH_S)
    gate = Gate()
    return uvicorn.Server(
        uvicorn.Config(
            app,
            http=functools.partial(PatientProtocol, gate),  # type: ignore[arg-type]
            # What is accepted at once must find files too.
            backlog=min(BACKLOG, gate.most // 2),
            access_log=False,
            server_header=False,
            proxy_headers=False,
            log_level="warning",
            timeout_graceful_shutdown=2,
            ws_max_size=4096,
            # JPEG does not shrink; trying to would cost more than everything else of a frame.
            ws_per_message_deflate=False,
            ssl_certfile=tls.certificate if tls else None,
            ssl_keyfile=tls.key if tls else None,
        )
    )


@contextlib.contextmanager
def serving(app: FastAPI, bound: socket.socket) -> Iterator[int]:
    """Serve `app` from another thread; yield the port, stop at the end."""
    server = server_of(app)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [bound]}, daemon=True)
    thread.start()
    try:
        while not server.started:
            if not thread.is_alive():
                raise AirlensError("The service did not start; its log says why.")
            time.sleep(0.01)
        yield bound.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join(timeout=10)
        bound.close()
