"""Cancels jobs at random moments: how soon there is a checkpoint, and how soon the process is gone.

    python -m tests.benchmarks.cancel --times 10

One JSON line a kind of job. `checkpoint_s` is the time from the request to the last checkpoint's being on disk
(missing where the computation had nothing to keep yet, as while it compiles); at worst 2 s. `gone_s` is until
the process has ended; at worst 15 s, for then it is killed.
"""

import argparse
import contextlib
import json
import os
import random
import tempfile
import threading
import time
from importlib.resources import files
from pathlib import Path

import psutil
from typer.testing import CliRunner

from app.cli import create_cli
from app.jobs import JobsConfig, JobSpec, JobState, Ledger, Supervisor
from app.jobs.folder import JobFolder, read_json


def experiment(folder: Path) -> Path:
    """A simulated experiment on a grid that takes some seconds to solve."""
    with (files("app.simulate.sample") / "room.npz").open() as truth:
        options = ["--truth", truth.name, "--world", "ideal", "--camera-px", "256", "--frames", "4"]
    CliRunner().invoke(create_cli(), ["simulate", str(folder), *options], catch_exceptions=False)
    settings = folder / "experiment.toml"
    settings.write_text(settings.read_text().replace('grid = "auto"', "grid = 24"))
    return folder


def cancelled(ledger: Ledger, spec: JobSpec, chance: random.Random, span_s: float) -> dict[str, float]:
    """Cancel one job at a random moment within `span_s` after its first progress."""
    job = ledger.submit(spec)
    attempt = JobFolder(ledger.folder_of(job.id)).attempt(1)
    _until(lambda: ledger.get(job.id).step > 0 or ledger.get(job.id).state.is_finished)
    time.sleep(span_s * chance.random())
    if ledger.get(job.id).state is not JobState.running:
        return {}
    process = psutil.Process(read_json(attempt / "worker.json")["pid"])
    asked_s = time.time()
    ledger.cancel(job.id)
    _until(lambda: _gone(process))
    found = {"gone_s": time.time() - asked_s}
    kept = [p.stat().st_mtime for p in (attempt / "checkpoint").glob("*") if not p.name.startswith(".")]
    if kept and max(kept) >= asked_s:
        found["checkpoint_s"] = max(kept) - asked_s
    _until(lambda: ledger.get(job.id).state.is_finished)
    return found


def _gone(process: psutil.Process) -> bool:
    with contextlib.suppress(psutil.NoSuchProcess):
        return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE
    return True


def _until(condition, limit_s: float = 300.0) -> None:
    deadline_s = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > deadline_s:
            raise TimeoutError
        time.sleep(0.005)


def main() -> None:
    """Parse the options and print a line a kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ledger, stop = Ledger(folder / "jobs"), threading.Event()
        supervisor = threading.Thread(target=Supervisor(ledger, JobsConfig()).run, args=(stop,))
        supervisor.start()
        rig = experiment(folder / "experiment")
        study = JobSpec(kind="noise-study", settings={"trials": 1_000_000})
        grid = JobSpec(kind="reconstruct", experiment=rig, settings={"preset": "grid"})
        try:
            for title, spec, times, span_s in (
                ("noise-study", study, options.times, 3.0),
                ("reconstruct grid 24^3", grid, max(1, options.times // 2), 4.0),
            ):
                _tell(title, spec, times, span_s, ledger, random.Random(options.seed))
        finally:
            stop.set()
            supervisor.join()


def _tell(
    title: str, spec: JobSpec, times: int, span_s: float, ledger: Ledger, chance: random.Random
) -> None:
    found = [cancelled(ledger, spec, chance, span_s) for _ in range(times)]
    kept = [one["checkpoint_s"] for one in found if "checkpoint_s" in one]
    gone = [one["gone_s"] for one in found if one]
    record = {
        "what": title,
        "cancelled": len(gone),
        "with_a_new_checkpoint": len(kept),
        "checkpoint_s_worst": round(max(kept), 2) if kept else None,
        "gone_s_worst": round(max(gone), 2) if gone else None,
        "load_average": round(os.getloadavg()[0], 1),
    }
    print(json.dumps(record), flush=True)


if __name__ == "__main__":
    main()
