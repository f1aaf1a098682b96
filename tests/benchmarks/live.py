"""How long after a burst T is there, in the process beside a capture: seconds by stage, with the error of T.

    python -m tests.benchmarks.live ROOM.npz --camera-px 2048x1536 --out tests/benchmarks/results/live.jsonl

A simulated experiment before an ideal lab's wall; its flow is looked at `--times` times in one process, as bursts of
a series would be, after the reference was made ready. One JSON line: medians of wall and CPU seconds of reading,
measuring and solving, the rms error of T in kelvin and that of the still air, and the load average meanwhile.
"""

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import app.live.burst_draft as burst_draft
from app.commands.simulate import parse_size
from app.experiment.folder import open_experiment
from app.experiment.rig_settings import SimulatedCameraSettings
from app.files.compilation_cache import use_compilation_cache
from app.files.provenance import provenance
from app.simulate.experiment import simulate
from app.volume.file import read_volume
from app.volume.scene import RIG_PLACES, RigOptions
from app.volume.score import score_solution

STAGES = {"read": "load_capture", "measure": "measure", "solve": "solve_draft"}


class Stopwatch:
    """Wall and CPU seconds of the functions that it was put around, by stage."""

    def __init__(self) -> None:
        self.wall_s: dict[str, float] = {}
        self.cpu_s: dict[str, float] = {}

    def around(self, stage: str, act: Callable[..., Any]) -> Callable[..., Any]:
        """The same function, timed."""

        def timed(*positional: Any, **named: Any) -> Any:
            wall_s, cpu_s = time.perf_counter(), time.process_time()
            try:
                return act(*positional, **named)
            finally:
                self.wall_s[stage] = self.wall_s.get(stage, 0.0) + time.perf_counter() - wall_s
                self.cpu_s[stage] = self.cpu_s.get(stage, 0.0) + time.process_time() - cpu_s

        return timed


def looked(experiment: Path, times: int) -> tuple[dict[str, Any], Any]:
    """Times of a burst, and the last solution."""
    began_s, began_cpu_s = time.perf_counter(), time.process_time()
    draft = burst_draft.BurstDraft(experiment)
    draft.rehearse()
    ready = {"ready_wall_s": time.perf_counter() - began_s, "ready_cpu_s": time.process_time() - began_cpu_s}
    flow = open_experiment(experiment).latest_capture("flow")
    seen = draft.of(flow)  # the noise of the series is worked out with its first burst
    plain = {name: getattr(burst_draft, name) for name in STAGES.values()}
    rows: list[dict[str, float]] = []
    for _ in range(times):
        watch = Stopwatch()
        for stage, name in STAGES.items():
            setattr(burst_draft, name, watch.around(stage, plain[name]))
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        seen = draft.of(flow)
        row = {"wall_s": time.perf_counter() - wall_s, "cpu_s": time.process_time() - cpu_s}
        row |= {f"{stage}_wall_s": s for stage, s in watch.wall_s.items()}
        rows.append(row | {f"{stage}_cpu_s": s for stage, s in watch.cpu_s.items()})
    for name, act in plain.items():
        setattr(burst_draft, name, act)
    medians = {key: round(median(row[key] for row in rows), 3) for key in rows[0]}
    return {key: round(value, 2) for key, value in ready.items()} | medians | {"noise_k": seen.noise_k}, seen


def main() -> None:
    """Print one row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("room", type=Path)
    parser.add_argument("--camera-px", default="2048x1536")
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--out", type=Path, default=None, help="also append the row to this file")
    options = parser.parse_args()
    use_compilation_cache()
    size = parse_size(options.camera_px)
    stand_off_m, baseline_m = RIG_PLACES["lab"]
    rig = RigOptions(camera_px=size, frames=options.frames, stand_off_m=stand_off_m, baseline_m=baseline_m)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "experiment"
        experiment = simulate(options.room, folder, rig, "operator", SimulatedCameraSettings())
        row, seen = looked(experiment, options.times)
        scored = score_solution(seen.solution, read_volume(options.room))["T"]
    line = {
        "room": options.room.stem,
        "camera_px": options.camera_px,
        "frames": options.frames,
        **row,
        "T_rms_k": scored["rms_K"],
        "still_rms_k": scored["trivial"]["ambient"],
        "load": round(os.getloadavg()[0], 1),
        **{key: value for key, value in provenance().items() if isinstance(value, str)},
    }
    text = json.dumps(line)
    print(text)
    if options.out is not None:
        with options.out.open("a", encoding="utf-8") as file:
            file.write(text + "\n")


if __name__ == "__main__":
    main()
