"""Kiosk pages served from this process, for the command line: a thread that lives as long as they are used."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

import uvicorn

from app.errors import AirlensError
from app.kiosk.routes import create_kiosk_app
from app.kiosk.screens import KioskScreens

START_S = 10.0


@contextlib.contextmanager
def serve_kiosk(screens: KioskScreens, port: int = 0) -> Iterator[str]:
    """Yield the address before the pages' paths while they are served. Raises AirlensError for a port that is taken.

    `page_of` has the path of each page.
    """
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
    except OSError as error:
        listener.close()
        raise AirlensError(
            f"Port {port} cannot be used ({error.strerror}). Choose another with --port, or 0 for any."
        ) from None
    settings = uvicorn.Config(create_kiosk_app(screens), log_level="warning", lifespan="off")
    server = uvicorn.Server(settings)
    thread = threading.Thread(target=server.run, args=([listener],), name="kiosk", daemon=True)
    thread.start()
    deadline_s = time.monotonic() + START_S
    while not server.started and time.monotonic() < deadline_s:
        time.sleep(0.01)
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(START_S)
        listener.close()
