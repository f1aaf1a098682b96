"""SIGTERM and SIGKILL to a job at random moments: how soon it is gone, and that it goes on to the same bits.

    python -m tests.benchmarks.terminate EXPERIMENT --preset standard --times 10

A real worker on an experiment (made by `airlens simulate`). It runs undisturbed, then with a signal at a random
moment of that time, begun anew after each. One JSON line a signal, and one at the end. `--cells` makes a room's grids
smaller where 48^3 would take too long, and sets the cells of `grid`.
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

from app import worker
from app.experiment.results import read_result
from app.jobs import JobSpec, Ledger
from app.jobs.folder import JobFolder, Owner
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

    def doing(self) -> str:
        """What it said last that it does."""
        try:
            lines = (self.folder.attempt(self.number) / "events.jsonl").read_text().splitlines()
        except FileNotFoundError:
            return "start"
        told = [json.loads(line) for line in lines]
        return next((e["body"]["stage"] for e in reversed(told) if e["kind"] == "stage"), "start")

    def bits(self) -> bytes:
        """The result's fields."""
        found = read_result(self.folder.target() / "result.nc")
        fields = (found.temperature_k, found.pressure_m2_s2, found.velocity_m_s, found.temperature_std_k)
        return b"".join(b"" if field is None else field.tobytes() for field in fields)


def work(folder: str, cells: int) -> int:
    """Be the worker, with a smaller room."""
    if cells:
        small = replace(presets.STANDARD, cells=cells, coarse_cells=cells * 2 // 3, vertices=cells + 1)

        def solve(problem, watch: Watch = Watch()) -> Solution:
            return solve_room(problem, small, watch)

        presets.PRESETS = {**presets.PRESETS, "standard": solve}
    return worker.main([folder])


def disturbed(runs: Runs, number: signal.Signals, after_s: float) -> dict[str, object] | None:
    """One attempt with a signal after so long; None where it ended before."""
    with runs.begin() as process:
        try:
            process.wait(after_s)
            return None
        except subprocess.TimeoutExpired:
            doing, sent_s = runs.doing(), time.perf_counter()
        process.send_signal(number)
        process.wait(120)
    gone_s = time.perf_counter() - sent_s
    row = {"signal": number.name, "after_s": round(after_s, 1), "doing": doing}
    return {**row, "exit": process.returncode, "gone_s": round(gone_s, 2)}


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
        return work(options.work, options.cells)
    with tempfile.TemporaryDirectory() as scratch:
        experiment = Path(scratch) / "experiment"
        shutil.copytree(options.experiment, experiment, ignore=shutil.ignore_patterns("results"))
        settings = experiment / "experiment.toml"
        if options.cells:
            settings.write_text(re.sub(r"grid = .*", f"grid = {options.cells}", settings.read_text()))
        point = {"preset": options.preset, "cells": options.cells or None}
        # Twice: what the first compiles the second need not.
        for _ in range(2):
            whole = Runs(Path(scratch), experiment, options.preset, options.cells)
            began_s = time.perf_counter()
            with whole.begin() as process:
                process.wait()
            whole_s = time.perf_counter() - began_s
        print(json.dumps({**point, "whole_s": round(whole_s, 1), "load": os.getloadavg()[0]}), flush=True)
        chance, runs = (
            random.Random(options.seed),
            Runs(Path(scratch), experiment, options.preset, options.cells),
        )
        gone, ended = [], False
        for n in range(options.times):
            row = disturbed(runs, _SIGNALS[n % 2], chance.uniform(0.05, 0.9) * whole_s)
            ended = row is None
            if row is None:
                break
            gone.append(row["gone_s"])
            print(json.dumps({**point, **row}), flush=True)
        if not ended:
            with runs.begin() as process:
                process.wait()
        same = runs.bits() == whole.bits()
        print(json.dumps({**point, "signals": len(gone), "gone_s_worst": max(gone), "same_bits": same}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
