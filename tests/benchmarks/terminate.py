"""SIGTERM to a `grid` job in the middle of a level: how long until its checkpoint is written, and until it is gone.

A real worker on an experiment (made by `airlens simulate`), at `--cells` an axis. One JSON line a signal; the job
goes on from its checkpoint between two of them.
"""

import argparse
import json
import re
import shutil
import signal
import tempfile
import time
from pathlib import Path

from core.checkpoint import decode
from tests.app.jobs.test_resume import Attempts


def compiled(job: Attempts, steps: int, limit_s: float) -> bool:
    """Wait until `steps` steps of this attempt are kept: the level is compiled, and conjugate gradients run."""
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        kept = job.kept()
        if kept and decode(kept[-1].read_bytes()).header["step"] >= steps:
            return True
        time.sleep(0.1)
    return False


def main() -> None:
    """Print one JSON line a signal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("experiment", type=Path)
    parser.add_argument("--cells", type=int, default=64)
    parser.add_argument("--steps", type=int, nargs="+", default=[13, 14])
    parser.add_argument("--limit-s", type=float, default=400.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        experiment = Path(scratch) / "experiment"
        shutil.copytree(options.experiment, experiment)
        settings = experiment / "experiment.toml"
        settings.write_text(re.sub(r"grid = .*", f"grid = {options.cells}", settings.read_text()))
        job = Attempts(Path(scratch) / "jobs", experiment, Path(scratch) / "cache")
        for steps in options.steps:
            with job.begin() as process:
                reached = compiled(job, steps, options.limit_s)
                time.sleep(1.0)
                before = {path: path.stat().st_mtime_ns for path in job.kept()}
                sent, sent_ns = time.perf_counter(), time.time_ns()
                process.send_signal(signal.SIGTERM)
                process.wait(60)
                gone_s = time.perf_counter() - sent
            # Newest since the signal; a step that was just kept counts as well.
            written = [p.stat().st_mtime_ns for p in job.kept() if before.get(p) != p.stat().st_mtime_ns]
            line = {"cells": options.cells, "steps": steps, "reached": reached, "exit": process.returncode}
            line |= {"checkpoint_s": round((max(written) - sent_ns) / 1e9, 2) if written else None}
            print(json.dumps({**line, "gone_s": round(gone_s, 2)}), flush=True)


if __name__ == "__main__":
    main()
