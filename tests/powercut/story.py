"""Jobs and captures lived through on the forgetful file system, and what must be left of them after a cut.

What was promised stands in the trace itself: `/promises` is written after a call returned; a worker tells
its progress after its checkpoint; it leaves exit.json after its result.
"""

import base64
import contextlib
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app import worker
from app.errors import AirlensError
from app.experiment.captures import load_capture, write_capture
from app.jobs import Job, JobSpec, JobState, Ledger
from app.jobs.folder import JobFolder, Owner
from drivers.burst import Burst, CapturePlan
from drivers.capture import run_capture
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern
from tests.powercut.crash import materialise, read_trace, survivors

CONFIG = (
    "retry_first_s = 0.1\npoll_s = 0.05\nmemory_reserve_bytes = 0\nstart_limit_s = 300.0\nlease_s = 60.0\n"
)


@contextlib.contextmanager
def mounted(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Yield mount point and trace of a forgetful file system; unmount at the end."""
    mount, trace = folder / "mount", folder / "trace.jsonl"
    mount.mkdir()
    command = [sys.executable, "-m", "tests.powercut.forgetful", str(mount), str(trace)]
    daemon = subprocess.Popen(command)
    try:
        until(lambda: mount.is_mount() or daemon.poll() is not None, 30)
        yield mount, trace
    finally:
        subprocess.run(["fusermount3", "-u", "-z", str(mount)], check=False)
        daemon.wait(30)


@contextlib.contextmanager
def supervised(folder: Path) -> Iterator[None]:
    """Run the supervisor as a process of its own; stop it at the end."""
    child = subprocess.Popen([sys.executable, "-m", "app.jobs", str(folder)])
    try:
        yield
    finally:
        child.send_signal(signal.SIGTERM)
        child.wait(60)


def until(condition: Any, limit_s: float) -> None:
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "it did not come to pass in time"
        time.sleep(0.02)


def specs(count: int, trials: int) -> list[JobSpec]:
    settings = {"size_px": 64, "trials": trials}
    return [
        JobSpec(kind="noise-study", settings=settings | {"seed": n}, memory_bytes=1 << 26)
        for n in range(count)
    ]


def live(mount: Path, wanted: Sequence[JobSpec]) -> None:
    """Submit, compute, pause, resume and capture; write down each promise as soon as it was given."""
    ledger = Ledger(mount / "jobs")
    (ledger.folder / "jobs.toml").write_text(CONFIG)

    def promised(**what: str) -> None:
        with open(mount / "promises", "a") as file:
            file.write(json.dumps(what) + "\n")

    burst = take_burst()
    with supervised(ledger.folder):
        for n, spec in enumerate(wanted):
            promised(job=ledger.submit(spec, key=f"job-{n}").id)
            write_capture(mount / "experiment" / "captures" / f"c{n}", burst)
            promised(capture=f"c{n}")
        first = ledger.jobs()[0].id
        until(lambda: ledger.get(first).step > 0, 120)
        if ledger.get(first).state is JobState.running:
            ledger.pause(first)
            until(lambda: not ledger.get(first).state.is_active, 60)
            if ledger.get(first).state is JobState.paused:
                ledger.resume(first)
        until(lambda: all(job.state is JobState.done for job in ledger.jobs()), 300)
    ledger.store.close()


def live_on_a_full_disk(mount: Path, wanted: Sequence[JobSpec], writes: int) -> dict[str, Any]:
    """Let the disk be full after so many writes and free it a little later; return what happened.

    A submission that the full disk refuses is repeated with its key, as a client does.
    """
    folder, errors, ids = mount / "jobs", set(), []
    (mount / ".full").write_text(str(writes))
    freer = threading.Thread(target=_free_later, args=(mount,))
    freer.start()
    child = None
    try:
        while len(ids) < len(wanted) or not _all_done(folder):
            try:
                with Ledger(folder) as ledger:
                    (folder / "jobs.toml").write_text(CONFIG + "disk_reserve_bytes = 0\n")
                    ids = [ledger.submit(spec, key=f"job-{n}").id for n, spec in enumerate(wanted)]
            except (AirlensError, OSError) as error:
                errors.add(str(error))
            if child is None or child.poll() is not None:
                log = open(mount.parent / "supervisor.log", "ab")
                child = subprocess.Popen([sys.executable, "-m", "app.jobs", str(folder)], stderr=log)
                log.close()
            time.sleep(0.2)
    finally:
        freer.join()
        if child is not None:
            child.terminate()
            child.wait(60)
    ledger = Ledger(folder)
    events = [event.body.get("reason", "") for event in ledger.events()]
    told = errors | set((mount.parent / "supervisor.log").read_text().splitlines()) | set(events)
    damage = [tuple(row) for row in ledger.store.rows("PRAGMA integrity_check")] != [("ok",)]
    results = {_key(job): finish(ledger, job) for job in ledger.jobs()}
    ledger.store.close()
    return {"told": [text for text in told if _tells_full(text)], "damage": damage, "results": results}


def _free_later(mount: Path) -> None:
    """Wait until the disk is full (or all is done without it), leave it so for a moment, free it."""
    deadline_s = time.monotonic() + 60
    while shutil.disk_usage(mount).free and time.monotonic() < deadline_s:
        if (mount / "jobs").exists() and _all_done(mount / "jobs"):
            break
        time.sleep(0.05)
    time.sleep(1.0)
    (mount / ".full").write_text("-1")


def _all_done(folder: Path) -> bool:
    try:
        with Ledger(folder) as ledger:
            jobs = ledger.jobs()
    except (AirlensError, OSError):
        return False
    return bool(jobs) and all(job.state is JobState.done for job in jobs)


def _tells_full(text: str) -> bool:
    words = ("disk is full", "disk was full", "No space left", "Waiting for disk space", "disk I/O error")
    return any(word in text for word in words)


def take_burst() -> Burst:
    view = pattern()
    camera = SimulatedCamera(lambda: view, seed=5)
    return run_capture(camera, CapturePlan(role="flow", frames=2, exposure_s=0.01))


def record(folder: Path, wanted: Sequence[JobSpec]) -> list[dict[str, Any]]:
    """Live through the story once; return its trace."""
    with mounted(folder) as (mount, trace):
        live(mount, wanted)
    return read_trace(trace)


def undisturbed(folder: Path, wanted: Sequence[JobSpec]) -> dict[str, dict[str, bytes]]:
    """Return the files of each result by the job's settings, computed without interruption."""
    ledger = Ledger(folder)
    return {_key(job): finish(ledger, job) for job in map(ledger.submit, wanted)}


def finish(ledger: Ledger, job: Job) -> dict[str, bytes]:
    """Run a next attempt at the job in this process, as a retry would; return the result's files."""
    folder = JobFolder(ledger.folder_of(job.id))
    if not folder.is_published():
        owner = Owner(job.attempt + 1, "after the cut")
        folder.hand_over(owner)
        worker.compute(folder, owner, threading.Event())
    return {path.name: path.read_bytes() for path in (folder.path / "result").iterdir()}


def losses_after_cut(
    trace: list[dict], at: int, seed: int, expected: dict[str, dict[str, bytes]]
) -> list[str]:
    """Cut the power after `at` changes; return every promise that was broken."""
    before = [dict(change) for change in trace[:at]]
    entries, contents = survivors(before, random.Random(seed))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve() / "disk"
        materialise(entries, contents, folder)
        try:
            return list(_broken(folder, promises(before), expected))
        except (AirlensError, OSError, ValueError) as error:
            return [f"unreadable: {error}"]
        finally:
            shutil.rmtree(folder)


def promises(trace: Sequence[dict]) -> dict[str, Any]:
    """Return what had been promised by the end of a trace."""
    names = {c["node"]: (c["folder"], c["name"]) for c in trace if c["op"] == "make"}
    told: dict[str, Any] = {"job": [], "capture": [], "step": {}, "result": set()}
    for change in trace:
        if change["op"] == "write" and _path(names, change["node"])[-1] == "promises":
            for line in base64.b64decode(change["data"]).splitlines():
                for kind, value in json.loads(line).items():
                    told[kind].append(value)
        elif change["op"] == "write" and _path(names, change["node"])[-1] == "events.jsonl":
            line = json.loads(base64.b64decode(change["data"]).splitlines()[-1])
            body = line["body"]
            if body["step"] < body["steps"]:  # the last one is told before the result, without a checkpoint
                told["step"][_path(names, change["node"])[1]] = body["step"]
        elif change["op"] == "write" and _path(names, change["node"])[-1].startswith(".exit."):
            if json.loads(base64.b64decode(change["data"]))["status"] == 0:
                told["result"].add(_path(names, change["node"])[1])
    return told


def _broken(folder: Path, told: dict[str, Any], expected: dict[str, dict[str, bytes]]) -> Iterator[str]:
    for name in told["capture"]:
        if not load_capture(folder / "experiment" / "captures" / name).complete:
            yield f"capture {name} is not complete"
    if not (folder / "jobs").exists():
        yield from (f"job {job} is gone" for job in told["job"])
        return
    ledger = Ledger(folder / "jobs")
    if [tuple(row) for row in ledger.store.rows("PRAGMA integrity_check")] != [("ok",)]:
        yield "the ledger is damaged"
    known = {job.id: job for job in ledger.jobs()}
    yield from (f"job {job} is gone" for job in told["job"] if job not in known)
    for job in known.values():
        job_folder = JobFolder(ledger.folder / job.id)
        if (job.state is JobState.done or job.id in told["result"]) and not job_folder.is_published():
            yield f"the result of {job.id} is gone"
        if not job_folder.is_published() and _reached(job_folder.path) < told["step"].get(job.id, 0):
            yield f"the checkpoint of {job.id} is gone"
        if finish(ledger, job) != expected[_key(job)]:
            yield f"{job.id} goes on to another result"
    ledger.store.close()


def _reached(folder: Path) -> int:
    """Return the step of the furthest checkpoint; one that cannot be read raises."""
    steps = [0]
    for path in folder.glob("attempts/*/checkpoint/sums.npz"):
        with np.load(path, allow_pickle=False) as sums:
            steps.append(int(sums["trials"]))
    return max(steps)


def _path(names: dict[int, tuple[int, str]], node: int) -> list[str]:
    parts: list[str] = []
    while node in names:
        node, name = names[node]
        parts.insert(0, name)
    return parts or [""]


def _key(job: Job) -> str:
    return json.dumps(dict(job.settings), sort_keys=True)
