"""Polls a live service from many clients while viewers watch and a job runs; one JSON line at the end.

    python -m tests.benchmarks.load_service --clients 50 --viewers 8 --seconds 20

Measured: the latency of reads (p50, p99), frames/s and latency of each viewer at 1.3 Mpx, and how long a job
takes with and without the load. The job, the clients and the service share this machine's cores.
"""

import argparse
import asyncio
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from websockets.asyncio.client import connect

from app.jobs import JobsConfig, JobSpec, Ledger, Supervisor

READS = ("/api/jobs", "/api/devices/camera", "/api/captures/running", "/api/health", "/api/experiments")

SERVICE = """
import sys
from pathlib import Path
import numpy as np
from app.api import create_app
from app.api.server import listen, server_of
from app.api.settings import service_config
from drivers.simulated import SimulatedCamera
root, token = Path(sys.argv[1]), sys.stdin.readline().strip()
bound = listen("127.0.0.1", 0)
port = bound.getsockname()[1]
app = create_app(service_config(root, token, port))
rows, cols = np.mgrid[0:1024, 0:1280].astype(np.float32)
view = (0.5 + 0.3 * np.sin(rows / 5) * np.sin(cols / 5)).astype(np.float32)
app.state.services.camera.open("load", lambda: SimulatedCamera(lambda: view, seed=1))
print(port, flush=True)
server_of(app).run(sockets=[bound])
"""


async def read(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, path: str, head: str) -> None:
    """One request on a kept connection: little of the measured time is the client's own."""
    writer.write(f"GET {path} HTTP/1.1\r\n{head}\r\n".encode())
    answer = await reader.readuntil(b"\r\n\r\n")
    status, *fields = answer.decode().split("\r\n")
    assert " 200 " in status, status
    length = next(int(f.split(":")[1]) for f in fields if f.lower().startswith("content-length:"))
    await reader.readexactly(length)


async def poll(
    url: str,
    headers: dict[str, str],
    until_s: float,
    every_s: float,
    found: list[tuple[str, float]],
    seed: int,
) -> None:
    host = url.removeprefix("http://")
    reader, writer = await asyncio.open_connection(*host.split(":"))
    head = f"Host: {host}\r\n" + "".join(f"{k}: {v}\r\n" for k, v in headers.items())
    number = seed
    await asyncio.sleep(every_s * np.random.default_rng(seed).random())
    while time.monotonic() < until_s:
        began_s = time.perf_counter()
        path = READS[number % len(READS)]
        await read(reader, writer, path, head)
        found.append((path, time.perf_counter() - began_s))
        number += 1
        await asyncio.sleep(every_s)
    writer.close()


async def watch(url: str, headers: dict[str, str], until_s: float, frames: list[int]) -> None:
    address = url.replace("http", "ws") + "/api/devices/camera/live"
    async with connect(address, additional_headers=headers, proxy=None, max_size=None) as socket:
        await socket.send(json.dumps({"credits": 2}))
        seen = 0
        while time.monotonic() < until_s:
            await asyncio.wait_for(socket.recv(), 10)
            await socket.send(json.dumps({"credits": 1}))
            seen += 1
        frames.append(seen)


async def load(url: str, token: str, options: argparse.Namespace) -> dict[str, object]:
    headers = {"Authorization": f"Bearer {token}"}
    found: list[tuple[str, float]] = []
    # In another process: a viewer is another machine's browser, whose decoding must not delay the readers.
    command = [sys.executable, "-m", "tests.benchmarks.load_service", "--watch", url, *sizes(options)]
    viewers = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert viewers.stdin is not None
    viewers.stdin.write(token + "\n")
    viewers.stdin.close()
    assert viewers.stdout is not None
    assert viewers.stdout.readline().strip() == "watching"
    until_s = time.monotonic() + options.seconds
    await asyncio.gather(
        *(poll(url, headers, until_s, options.every_s, found, n) for n in range(options.clients))
    )
    frames = json.loads(viewers.stdout.read())
    viewers.wait()
    milliseconds = 1000 * np.array([seconds for _, seconds in found])
    by_path = {path: [1000 * s for p, s in found if p == path] for path in READS}
    return {
        "reads": len(found),
        "p50_ms": round(float(np.percentile(milliseconds, 50)), 2),
        "p99_ms": round(float(np.percentile(milliseconds, 99)), 2),
        "p99_ms_by_path": {path: round(float(np.percentile(ms, 99)), 1) for path, ms in by_path.items()},
        "slowest_ms": round(float(milliseconds.max()), 1),
        "viewer_frames_per_s": [round(n / options.seconds, 1) for n in frames],
    }


async def watch_all(url: str, token: str, options: argparse.Namespace) -> list[int]:
    headers, frames = {"Authorization": f"Bearer {token}"}, []
    print("watching", flush=True)
    until_s = time.monotonic() + options.seconds
    await asyncio.gather(*(watch(url, headers, until_s, frames) for _ in range(options.viewers)))
    return frames


def sizes(options: argparse.Namespace) -> list[str]:
    return ["--viewers", str(options.viewers), "--seconds", str(options.seconds)]


def job_wall_s(root: Path, trials: int) -> float:
    """Run one job to its end and return the wall time of its computation."""
    ledger, stop = Ledger(root / "jobs"), threading.Event()
    supervisor = threading.Thread(target=Supervisor(ledger, JobsConfig()).run, args=(stop,))
    supervisor.start()
    job = ledger.submit(JobSpec(kind="noise-study", settings={"trials": trials, "size_px": 128}))
    while not (found := ledger.get(job.id)).state.is_finished:
        time.sleep(0.1)
    stop.set()
    supervisor.join()
    return (found.finished_s or 0.0) - (found.started_s or 0.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--viewers", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--every-s", type=float, default=1.0, help="pause of one client between two reads")
    parser.add_argument("--trials", type=int, default=0, help="size of the job; 0 for none")
    parser.add_argument("--watch", metavar="URL", help="only view the live picture; the token on stdin")
    options = parser.parse_args()
    if options.watch:
        print(json.dumps(asyncio.run(watch_all(options.watch, sys.stdin.readline().strip(), options))))
        return
    token = "t" * 43
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        alone_s = job_wall_s(root / "alone", options.trials) if options.trials else 0.0
        service = subprocess.Popen(
            [sys.executable, "-c", SERVICE, str(root)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert service.stdin is not None
            assert service.stdout is not None
            service.stdin.write(token + "\n")
            service.stdin.flush()
            url = f"http://127.0.0.1:{int(service.stdout.readline())}"
            time.sleep(1)
            job: list[float] = []
            other = threading.Thread(target=lambda: job.append(job_wall_s(root, options.trials)))
            if options.trials:
                other.start()
            found = asyncio.run(load(url, token, options))
            if options.trials:
                other.join()
                found |= {"job_alone_s": round(alone_s, 2), "job_beside_s": round(job[0], 2)}
            found["load_average"] = round(os.getloadavg()[0], 1)
            service.terminate()
            service.wait()
            found["service_cpu_s"] = round(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, 1)
            print(json.dumps({"clients": options.clients, "viewers": options.viewers, **found}))
        finally:
            service.terminate()
            service.wait()


if __name__ == "__main__":
    main()
