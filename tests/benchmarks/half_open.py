"""Holds thousands of connections half open while a reader asks; one JSON line a limit of files.

    python -m tests.benchmarks.half_open --held 3000 --files 4096 --files 256

The service runs in a process of its own under each limit. The reader opens a new connection for every request.
"""

import argparse
import json
import multiprocessing
import resource
import socket
import tempfile
import time
from pathlib import Path
from typing import Any

import httpx

from app.api.security.settings import new_token, service_config

REQUESTS = 20


def serve(folder: str, token: str, files: int, ready: Any) -> None:
    """Serve until killed, with so many files."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))
    from app.api.factory import create_app
    from app.api.server import listen, serving

    bound = listen("127.0.0.1", 0)
    app = create_app(service_config(Path(folder), token, bound.getsockname()[1]))
    with serving(app, bound) as port:
        ready.send(port)
        time.sleep(1e6)


def ask(port: int, token: str) -> float:
    """Return the seconds that one request took, connecting included."""
    began_s = time.perf_counter()
    headers = {"Authorization": f"Bearer {token}"}
    httpx.get(
        f"http://127.0.0.1:{port}/api/health", headers=headers, timeout=60, trust_env=False
    ).raise_for_status()
    return time.perf_counter() - began_s


def measure(held: int, files: int) -> dict[str, Any]:
    """Return how long a reader waited beside `held` half-open connections."""
    own, ours = multiprocessing.Pipe()
    token = new_token()
    with tempfile.TemporaryDirectory() as folder:
        context = multiprocessing.get_context("spawn")
        service = context.Process(target=serve, args=(folder, token, files, ours), daemon=True)
        service.start()
        port = own.recv()
        alone_s = sorted(ask(port, token) for _ in range(REQUESTS))
        lines = []
        for number in range(held):
            line = socket.create_connection(("127.0.0.1", port), 60)
            line.sendall((b"", b"GET / HTTP/1.1\r\n", b"GET / HTTP/1.1\r\nHost: a\r\nX: ")[number % 3])
            lines.append(line)
        waited_s = sorted(ask(port, token) for _ in range(REQUESTS))
        for line in lines:
            line.close()
        service.kill()
        service.join()
    return {
        "benchmark": "half_open",
        "held": held,
        "files": files,
        "requests": REQUESTS,
        "alone_median_s": round(alone_s[REQUESTS // 2], 4),
        "median_s": round(waited_s[REQUESTS // 2], 4),
        "longest_s": round(waited_s[-1], 4),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--held", type=int, default=3000)
    parser.add_argument("--files", type=int, action="append")
    options = parser.parse_args()
    for files in options.files or [4096, 256]:
        print(json.dumps(measure(options.held, files)), flush=True)


if __name__ == "__main__":
    main()
