"""SIGTERM and SIGKILL to a job at random moments of its solve: how soon it is gone, and if its bits are the same.

    python -m tests.benchmarks.terminate EXPERIMENT --preset standard --times 10

A real worker on an experiment (made by `airlens simulate --world ideal`). It runs undisturbed; then it is killed at
random shares of its solver's work, and begun anew after each. One JSON line a signal, with what the solver said last,
and one at the end. `--cells` makes a room's grids smaller where 48^3 would take too long, and sets the cells of
`grid`.
"""

import argparse
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from app import worker
from app.experiment.results import read_result
from app.jobs import JobSpec, Ledger, worker_status
from app.jobs.folder import JobFolder, Owner
from app.jobs.told import whole_lines
from app.reconstruct import presets
from core.result import Solution
from core.solve.room import solve_room
from core.watch import Watch

ROOT = Path(__file__).parents[2]
_SIGNALS = (signal.SIGTERM, signal.SIGKILL)


class Runs:
    """One job, run by a new process each time."""

    def __init__(self, folder: Path, experiment: Path, preset: str, cells: int) -> None:
        ledger = Ledger(folder / "jobs")
        job = ledger.submit(JobSpec(kind="reconstruct", experiment=experiment, settings={"preset": preset}))
        self.folder, self.number, self._cells = JobFolder(ledger.folder_of(job.id)), 0, cells
        cache = {"JAX_COMPILATION_CACHE_DIR": str(folder / "cache")}
        self._environment = {**os.environ, **cache, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}

    def begin(self) -> subprocess.Popen:
        """Start the next attempt."""
        self.number += 1
        self.folder.hand_over(Owner(self.number, f"attempt {self.number}"))
        command = [sys.executable, "-m", "tests.benchmarks.terminate", "--work", str(self.folder.path)]
        return subprocess.Popen(
            [*command, "--cells", str(self._cells)],
            cwd=ROOT,
            env=self._environment,
            stderr=subprocess.DEVNULL,
        )

    def told(self) -> tuple[str, float]:
        """What it said last that it does, and the largest share of its solve that it has told."""
        lines, _ = whole_lines(self.folder.attempt(self.number) / "events.jsonl", 0)
        events = [json.loads(line) for line in lines]
        doing = next((e["body"]["stage"] for e in reversed(events) if e["kind"] == "stage"), "start")
        counted = [e["body"] for e in events if e["kind"] == "progress" and e["body"]["steps"]]
        return doing, max((body["step"] / body["steps"] for body in counted), default=0.0)

    def ends(self) -> None:
        """Run an attempt to its end. Raises RuntimeError where it fails."""
        with self.begin() as process:
            if process.wait() != worker_status.DONE:
                raise RuntimeError(f"The worker ended with status {process.returncode}.")

    def bits(self) -> bytes:
        """The result's fields."""
        found = read_result(self.folder.target() / "result.nc")
        fields = (found.temperature_k, found.pressure_m2_s2, found.velocity_m_s, found.temperature_std_k)
        return b"".join(b"" if field is None else field.tobytes() for field in fields)


def work(folder: str, cells: int) -> NoReturn:
    """Be the worker, with a smaller room."""
    if cells:
        small = replace(presets.STANDARD, cells=cells, coarse_cells=cells * 2 // 3, vertices=cells + 1)

        def solve(problem, watch: Watch = Watch()) -> Solution:
            return solve_room(problem, small, watch)

        presets.PRESETS = {**presets.PRESETS, "standard": solve}
    worker.end(worker.main([folder]))


def disturbed(runs: Runs, number: signal.Signals, share: float, later_s: float) -> dict[str, object] | None:
    """One attempt with a signal so long after it told so much; None where it ended before."""
    with runs.begin() as process:
        while runs.told()[1] < share and process.poll() is None:
            time.sleep(0.02)
        try:
            process.wait(later_s)
            return None
        except subprocess.TimeoutExpired:
            doing, told = runs.told()
            sent_s = time.perf_counter()
        process.send_signal(number)
        process.wait(120)
    gone_s = time.perf_counter() - sent_s
    row = {"signal": number.name, "share": round(told, 3), "doing": doing}
    return {**row, "exit": process.returncode, "gone_s": round(gone_s, 2)}


def copied(experiment: Path, folder: Path, cells: int) -> Path:
    """The experiment without its results, at another grid."""
    copy = folder / "experiment"
    shutil.copytree(experiment, copy, ignore=shutil.ignore_patterns("results"))
    if cells:
        settings = copy / "experiment.toml"
        settings.write_text(re.sub(r"grid = .*", f"grid = {cells}", settings.read_text()))
    return copy


def measured(options: argparse.Namespace, folder: Path) -> None:
    """Print the rows."""
    experiment = copied(options.experiment, folder, options.cells)
    point = {"preset": options.preset, "cells": options.cells or None}

    def say(**row: object) -> None:
        print(json.dumps({**point, **row}), flush=True)

    whole = Runs(folder, experiment, options.preset, options.cells)
    began_s = time.perf_counter()
    whole.ends()
    say(whole_s=round(time.perf_counter() - began_s, 1), load=os.getloadavg()[0])
    chance = random.Random(options.seed)
    # A solver's estimate of its own work may be too large: the moments lie in what it really told.
    shares = sorted(chance.uniform(0.0, whole.told()[1]) for _ in range(options.times))
    runs = Runs(folder, experiment, options.preset, options.cells)
    gone = []
    for n, share in enumerate(shares):
        row = disturbed(runs, _SIGNALS[n % 2], share, chance.uniform(0.0, 1.0))
        if row is None:
            break
        gone.append(row["gone_s"])
        say(**row)
    else:
        runs.ends()
    say(signals=len(gone), gone_s_worst=max(gone, default=None), same_bits=runs.bits() == whole.bits())


def main() -> int:
    """Print one JSON line a signal, and one at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("experiment", type=Path, nargs="?")
    parser.add_argument("--preset", default="standard")
    parser.add_argument("--times", type=int, default=10)
    parser.add_argument("--cells", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", help="be the worker of this job's folder")
    options = parser.parse_args()
    if options.work:
        work(options.work, options.cells)
    with tempfile.TemporaryDirectory() as scratch:
        measured(options, Path(scratch))
    return 0


if __name__ == "__main__":
    sys.exit(main())
