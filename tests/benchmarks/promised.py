"""Promised against taken: whole commands `airlens reconstruct`, with nothing compiled and with all of it.

    python -m tests.benchmarks.promised --out tests/benchmarks/results/promised.jsonl
    python -m tests.benchmarks.promised --set figures --out tests/benchmarks/results/stages.jsonl
    python -m tests.benchmarks.promised --print-figures > app/plan/tradeoff/stages.json     # from the latter

Each case is a simulated experiment and a preset, solved cold (a compilation cache of its own, empty) and then warm.
The machine's ledger begins empty, so the first cases are promised by the packaged figures, later ones by what was
learned. One JSON line a run: the promise, what the process took from its start to its end, the ratio, the seconds by
stage, how many runs were known, and the load average. On a busy machine the same run takes up to twice as long.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

from app.experiment.rig_settings import SimulatedCameraSettings
from app.files.toml import to_plain
from app.plan.promise import Figures, Line
from app.plan.runs import kept_runs
from app.simulate.experiment import simulate
from app.volume.scene import Information, RigOptions
from tests.rooms import ROOM, state_grid

AIRLENS = str(Path(sys.executable).with_name("airlens"))
STAGES = Path(__file__).parent / "results" / "stages.jsonl"


@dataclass(frozen=True)
class Case:
    """An experiment and how it is solved."""

    preset: str
    information: Information
    camera_px: int
    cells: int


CASES = (
    Case("draft", "surveyed", 160, 24),
    Case("grid", "surveyed", 160, 8),
    Case("standard", "surveyed", 160, 10),
    Case("draft", "operator", 384, 36),
    Case("draft", "surveyed", 768, 48),
    Case("grid", "operator", 384, 8),
    Case("grid", "surveyed", 160, 12),
    Case("standard", "surveyed", 384, 12),
    Case("draft", "paper", 1536, 24),
    Case("standard", "surveyed", 160, 14),
    Case("grid", "paper", 768, 16),
    Case("standard", "operator", 160, 12),
)


# What the packaged figures are made from.
FIGURES = (
    Case("draft", "surveyed", 160, 24),
    Case("grid", "surveyed", 160, 8),
    Case("standard", "surveyed", 160, 10),
    Case("draft", "surveyed", 1536, 24),
)


def measured(case: Case, scratch: Path) -> Iterable[dict[str, Any]]:
    """The rows of a case: cold, then warm."""
    name = "-".join(str(value) for value in asdict(case).values())
    options = RigOptions(camera_px=(case.camera_px, case.camera_px * 3 // 4), frames=2)
    experiment = simulate(ROOM, scratch / name, options, case.information, SimulatedCameraSettings())
    state_grid(experiment, case.cells)
    environment = {
        **os.environ,
        "AIRLENS_MACHINE": str(scratch / "machine.json"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    if case.preset == "standard":
        # As a user would: the plan says how much is to be marched. It compiles elsewhere.
        subprocess.run(
            [AIRLENS, "plan", str(experiment)],
            env={**environment, "JAX_COMPILATION_CACHE_DIR": str(scratch / "planned")},
            check=True,
            stdout=subprocess.DEVNULL,
        )
    cache = scratch / f"compiled-{name}"
    cache.mkdir()
    for state in ("cold", "warm"):
        known = len(kept_runs(scratch / "runs.jsonl"))
        told, taken_s = _run(
            experiment, case.preset, {**environment, "JAX_COMPILATION_CACHE_DIR": str(cache)}
        )
        run = kept_runs(scratch / "runs.jsonl")[-1]
        promised_s = told["promised_s"]
        yield {
            **asdict(case),
            "programs": state,
            "runs_known": known,
            "promised_s": None if promised_s is None else round(promised_s, 1),
            "taken_s": round(taken_s, 1),
            "ratio": None if promised_s is None else round(promised_s / taken_s, 2),
            "stages_s": run.seconds,
            "pixels": run.pixels,
            "work": run.work,
            "load": round(os.getloadavg()[0], 1),
            "date": run.at[:10],
        }


def _run(experiment: Path, preset: str, environment: dict[str, str]) -> tuple[dict[str, Any], float]:
    """What the command told as JSON, and its wall time [s]."""
    command = [AIRLENS, "reconstruct", str(experiment), "--preset", preset, "--json"]
    began_s = time.perf_counter()
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout), time.perf_counter() - began_s


def stage_rows() -> list[dict[str, Any]]:
    """The committed rows that the packaged figures are made from."""
    return [json.loads(line) for line in STAGES.read_text(encoding="utf-8").splitlines()]


def figures_of(rows: list[dict[str, Any]]) -> Figures:
    """The medians of rows as packaged figures; read and measure as lines through small and large pictures."""

    def seconds(stage: str, **of: str) -> float:
        chosen = [r for r in rows if all(r[key] == value for key, value in of.items())]
        return round(median(r["stages_s"][stage] for r in chosen), 2)

    presets = sorted({row["preset"] for row in rows})
    return Figures(
        measured=max(row["date"] for row in rows),
        start_s=seconds("start"),
        read=_line(rows, "read"),
        measure=_line(rows, "measure"),
        cold_s={preset: seconds("compile", preset=preset, programs="cold") for preset in presets},
        warm_s={preset: seconds("compile", preset=preset, programs="warm") for preset in presets},
        report_s={preset: seconds("report", preset=preset) for preset in presets},
    )


def _line(rows: list[dict[str, Any]], stage: str) -> Line:
    """Through the medians at the smallest and at the largest pictures; never falling."""
    sizes = sorted({row["pixels"] for row in rows})
    small, large = sizes[0], sizes[-1]
    ends = [median(r["stages_s"][stage] for r in rows if r["pixels"] == size) for size in (small, large)]
    slope = max(0.0, ends[1] - ends[0]) / (large - small)
    return Line(fixed_s=round(max(0.0, ends[0] - slope * small), 3), s_per_pixel=float(f"{slope:.3g}"))


def main() -> None:
    """Print the rows, or the figures that rows make."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=None, help="also append the rows to this file")
    parser.add_argument(
        "--set", choices=("promised", "figures"), default="promised", help="which cases to run"
    )
    parser.add_argument("--first", type=int, default=0, help="the first case, if some ran before")
    parser.add_argument("--print-figures", action="store_true", help="print what stages.jsonl makes")
    options = parser.parse_args()
    if options.print_figures:
        print(json.dumps(to_plain(figures_of(stage_rows())), indent=1))
        return
    with tempfile.TemporaryDirectory() as scratch:
        for case in {"promised": CASES, "figures": FIGURES}[options.set][options.first :]:
            for row in measured(case, Path(scratch)):
                line = json.dumps(row)
                print(line, flush=True)
                if options.out is not None:
                    with options.out.open("a", encoding="utf-8") as file:
                        file.write(line + "\n")


if __name__ == "__main__":
    main()
