"""Polls a live service from many clients while viewers watch and a job runs; one JSON line a trial.

    python -m tests.benchmarks.load_service --clients 50 --viewers 8 --seconds 15 --trials 4

One long job runs all the time. In turns the service is left alone and loaded, so that the job's speed
(its steps a second) is compared with itself a moment before. Measured under load: the latency of reads (p50,
p99) from many clients, frames/s of each viewer at 1.3 Mpx, the slow-down of the job, and the CPU seconds of the
service and of what loads it (clients and viewers, which would be other machines). The camera replays frames
that were drawn before: drawing noise is a simulation's work, not a service's.
"""

import argparse
import asyncio
import contextlib
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
from websockets.asyncio.client import connect

from app.jobs import JobSpec, JobState, Ledger

READS = ("/api/jobs", "/api/devices/camera", "/api/captures/running", "/api/health", "/api/experiments")

SERVICE = """
import dataclasses
import sys
import time
from pathlib import Path
import numpy as np
from app.api.factory import create_app
from app.api.server import listen, server_of
from app.api.security.settings import service_config
from drivers.simulated import SimulatedCamera


class Replay(SimulatedCamera):
    # The same few frames again and again, as fast as a driver hands over a buffer.

    def grab(self):
        if len(drawn) < 8:
            drawn.append(super().grab())
        last[0] += 1
        return dataclasses.replace(drawn[last[0] % len(drawn)], sequence=last[0], timestamp_s=time.time())


drawn, last = [], [0]
root, token = Path(sys.argv[1]), sys.stdin.readline().strip()
bound = listen("127.0.0.1", 0)
port = bound.getsockname()[1]
app = create_app(service_config(root, token, port))
rows, cols = np.mgrid[0:1024, 0:1280].astype(np.float32)
view = (0.5 + 0.3 * np.sin(rows / 5) * np.sin(cols / 5)).astype(np.float32)
app.state.services.camera.open("load", lambda: Replay(lambda: view, seed=1))
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


class Steps:
    """How far a job is, read from what it told; between two tellings a straight line."""

    def __init__(self, ledger: Ledger, job: str) -> None:
        self._ledger, self._job = ledger, job

    def per_s(self, began_s: float, ended_s: float) -> float:
        """Return its speed between two moments (Unix time); all of it must have been told."""
        told = [
            (event.at_s, event.body["step"])
            for event in self._ledger.events(after=0, job=self._job, limit=100_000)
            if event.kind == "progress"
        ]
        times_s, steps = np.array(told).T
        first, last = np.interp([began_s, ended_s], times_s, steps)
        return float((last - first) / (ended_s - began_s))

    def wait_until(self, moment_s: float) -> None:
        """Wait until it has told of progress after a moment."""
        while True:
            told = self._ledger.events(after=0, job=self._job, limit=100_000)
            if any(e.kind == "progress" and e.at_s > moment_s for e in told):
                return
            time.sleep(0.2)


@contextlib.contextmanager
def running_job(root: Path) -> Iterator[Steps]:
    """A job that does not end by itself, under a supervisor of its own process."""
    ledger = Ledger(root / "jobs")
    command = [sys.executable, "-m", "app.jobs", str(ledger.folder)]
    with subprocess.Popen(command) as supervisor:
        job = ledger.submit(JobSpec(kind="noise-study", settings={"trials": 10_000_000, "size_px": 128})).id
        steps = Steps(ledger, job)
        steps.wait_until(0.0)
        yield steps
        ledger.cancel(job)
        while ledger.get(job).state is not JobState.cancelled:
            time.sleep(0.1)
        supervisor.terminate()


@contextlib.contextmanager
def running_service(root: Path, token: str) -> Iterator[tuple[str, psutil.Process]]:
    """The service in a process of its own; its address."""
    command = [sys.executable, "-c", SERVICE, str(root)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as service:
        assert service.stdin is not None
        assert service.stdout is not None
        service.stdin.write(token + "\n")
        service.stdin.flush()
        yield f"http://127.0.0.1:{int(service.stdout.readline())}", psutil.Process(service.pid)
        service.terminate()


def cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return times.user + times.system


def spent_s() -> float:
    """CPU seconds of this process and of its ended children."""
    return sum(os.times()[:4])


def trial(url: str, token: str, service: psutil.Process, steps: Steps, options: argparse.Namespace) -> dict:
    """Leave the service alone, then load it; return what was measured."""
    quiet = (time.time(), time.sleep(options.seconds), time.time())[::2]
    before_s, own_s, began_s = cpu_s(service), spent_s(), time.time()
    found = asyncio.run(load(url, token, options))
    ended_s = time.time()
    service_s, generator_s = cpu_s(service) - before_s, spent_s() - own_s
    steps.wait_until(ended_s)
    alone, beside = steps.per_s(*quiet), steps.per_s(began_s, ended_s)
    return found | {
        "job_steps_per_s_alone": round(alone, 1),
        "job_steps_per_s_beside": round(beside, 1),
        "job_slowed_percent": round(100 * (alone / beside - 1), 1),
        "service_cores": round(service_s / (ended_s - began_s), 2),
        "generator_cores": round(generator_s / (ended_s - began_s), 2),
        "load_average": round(os.getloadavg()[0], 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--viewers", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--every-s", type=float, default=1.0, help="pause of one client between two reads")
    parser.add_argument("--trials", type=int, default=4)
    parser.add_argument("--watch", metavar="URL", help="only view the live picture; the token on stdin")
    options = parser.parse_args()
    if options.watch:
        print(json.dumps(asyncio.run(watch_all(options.watch, sys.stdin.readline().strip(), options))))
        return
    token = "t" * 43
    with (
        tempfile.TemporaryDirectory() as folder,
        running_service(Path(folder), token) as (url, service),
        running_job(Path(folder)) as steps,
    ):
        for _ in itertools.repeat(None, options.trials):
            found = trial(url, token, service, steps, options)
            print(json.dumps({"clients": options.clients, "viewers": options.viewers, **found}), flush=True)


if __name__ == "__main__":
    main()
