"""What a second and a third view add: one room, seen at y_max alone, with x_max too, with the ceiling too.

Each is an experiment of its own, simulated, reconstructed and scored by the product's functions. One JSON line a set
of views: the errors of T and u, how many points the 95 % intervals hold, and the seconds. `T_air_rms_K` leaves out
the vertices on the walls: those on a wall of unknown temperature that a camera looks through have the wall's own.
`T_expected_K` is the rms deviation that the result itself gives for these.
`line_means_K` is the error of the best sum of fields that each do not vary along one of the views: what means along
parallel lines, without noise, leave to whoever knows nothing else. `figures_missed` are those of `airlens indoor`
whose 95 % interval does not hold the truth's, of so many `figures` that have one.

With `--side x_min` the second camera looks at x_min, where the rooms' supplies are, and stands opposite to them.
`--views 2` takes the sets of two views alone.

    python -m tests.benchmarks.views TRUTH.npz ... [--camera-px 1024] [--frames 60] [--preset draft] [--world lab]
        [--side x_min] [--views 2]
        [--seed 0] [--seeds 20]    # as many, from that one on; each seed with all rooms before the next one
    python -m tests.benchmarks.views --summary [--camera-px 1024] ...    # over the seeds of the rows that are kept
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from app.experiment.folder import open_experiment
from app.pipeline import reconstruct
from app.simulate.experiment import simulate
from app.simulate.worlds import WORLDS
from app.volume.file import RoomVolume, read_volume
from app.volume.scene import RIG_PLACES, RigOptions
from app.volume.score import score_experiment
from core.geometry import WallName
from core.result import Solution
from tests.benchmarks.indoor_coverage import row_of

_ROWS = Path(__file__).parent / "results" / "views.jsonl"
_AXES = {"x": 0, "y": 1, "z": 2}


def sets_of(side: WallName, views: int | None) -> list[tuple[WallName, ...]]:
    """The walls that are looked at: one, two and three of them, or so many as `views`."""
    walls: tuple[WallName, ...] = ("y_max", side, "z_max")
    return [walls[:n] for n in (1, 2, 3) if views in (None, n)]


def line_means_k(truth: RoomVolume, walls: tuple[WallName, ...]) -> float:
    """The rms in the air of what no view along `walls` shows at all."""
    left = truth.temperature_k[1:-1, 1:-1, 1:-1].astype(np.float64)
    # Means along different axes commute, so the projections on what they leave multiply.
    for wall in walls:
        left = left - left.mean(axis=_AXES[wall[0]], keepdims=True)
    air = np.ones(left.shape, bool) if truth.solid is None else ~truth.solid[1:-1, 1:-1, 1:-1]
    return float(np.sqrt(np.mean(left[air] ** 2)))


def expected_k(solution: Solution) -> float | None:
    """The rms deviation of T that a result gives for the vertices off the walls; no obstacle is left out."""
    if solution.temperature_std_k is None:
        return None
    return float(np.sqrt(np.mean(np.asarray(solution.temperature_std_k)[1:-1, 1:-1, 1:-1] ** 2)))


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("truth", type=Path, nargs="*")
    parser.add_argument("--summary", action="store_true")
    parser.add_argument("--camera-px", type=int, default=1024)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--preset", default="draft")
    parser.add_argument("--information", default="operator")
    parser.add_argument("--rig", default="lab", choices=RIG_PLACES)
    parser.add_argument("--world", default="ideal", choices=tuple(WORLDS))
    parser.add_argument("--side", default="x_max", choices=("x_min", "x_max"))
    parser.add_argument("--views", type=int, choices=(1, 2, 3), help="this many alone; else each number")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=1)
    asked = parser.parse_args()
    if asked.summary:
        for line in summary(asked, [json.loads(line) for line in _ROWS.read_text().splitlines()]):
            print(json.dumps(line))
        return
    for seed in range(asked.seed, asked.seed + asked.seeds):
        for truth in asked.truth:
            for walls in sets_of(asked.side, asked.views):
                print(json.dumps(row(asked, truth, seed, walls)), flush=True)


def summary(asked: argparse.Namespace, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Over the seeds: rms errors of T and u, the least within, and each seed beside one view of its own."""
    walls = [list(each) for each in sets_of(asked.side, asked.views)]
    alike = ("preset", "information", "rig", "world", "camera_px", "frames")
    # A later row of the same experiment takes the place of an earlier one.
    kept = {
        (row["room"], len(row["views"]), row["seed"]): row
        for row in rows
        if row["views"] in walls and all(row.get(key) == getattr(asked, key) for key in alike)
    }
    lines = []
    for room, views in sorted({key[:2] for key in kept}):
        seeds = sorted(seed for one, count, seed in kept if (one, count) == (room, views))
        these = [kept[room, views, seed] for seed in seeds]
        line: dict[str, Any] = {"room": room, "views": views, "seeds": len(seeds)}
        for name in ("T_air_rms_K", "T_expected_K", "u"):
            values = np.array([row[name] for row in these if row.get(name) is not None])
            line[name] = float(np.sqrt(np.mean(values**2))) if len(values) == len(seeds) else None
        for name in ("T_within", "u_within"):
            line[name] = min((row[name] for row in these if row[name] is not None), default=None)
        for name in ("T_air_rms_K", "u"):
            pairs = [(kept.get((room, 1, seed)), row) for seed, row in zip(seeds, these, strict=True)]
            ratios = [one[name] / row[name] for one, row in pairs if one and one[name] and row[name]]
            if views > 1 and ratios:
                worse = sum(ratio < 1.0 for ratio in ratios)
                line |= {f"{name}_better": [min(ratios), max(ratios)], f"{name}_worse": [worse, len(ratios)]}
        lines.append(line)
    return lines


def row(asked: argparse.Namespace, truth: Path, seed: int, walls: tuple[WallName, ...]) -> dict[str, Any]:
    """One experiment."""
    stand_off_m, baseline_m = RIG_PLACES[asked.rig]
    options = RigOptions(
        camera_px=(asked.camera_px, asked.camera_px * 3 // 4),
        frames=asked.frames,
        stand_off_m=stand_off_m,
        baseline_m=baseline_m,
        pattern_seed=seed,
        walls=walls,
    )
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "room"
        world = WORLDS[asked.world]
        simulate(truth, folder, options, asked.information, world.camera(seed), misreads=world.misreads)
        done = reconstruct(folder, asked.preset)
        scores = score_experiment(folder, truth)
        scene = open_experiment(folder).settings.scene
    volume = read_volume(truth)
    return {
        "room": truth.stem,
        "views": walls,
        "preset": asked.preset,
        "information": asked.information,
        "rig": asked.rig,
        "world": asked.world,
        "camera_px": asked.camera_px,
        "frames": asked.frames,
        "seed": seed,
        "T_rms_K": scores["T"]["rms_K"],
        "T_air_rms_K": scores["T"]["air"]["rms_K"],
        "T_expected_K": expected_k(done.solution),
        "line_means_K": line_means_k(volume, walls),
        "T_departure": scores["T"]["rel_departure"],
        "T_within": scores["T_within"],
        "u": None if scores["u"] is None else scores["u"]["rel"],
        "u_within": scores["u_within"],
        "solver_s": round(scores["solver_s"], 1),
        "wall_s": round(done.wall_s, 1),
        "outcome": scores["outcome"],
        **row_of(done.solution, truth, scene),
        "notes": [*done.measurement.notes, *done.solution.notes],
    }


if __name__ == "__main__":
    main()
