"""Is a border with the room's air before it doubted, and a truly still one believed? Over seeds.

    python -m tests.benchmarks.yardstick ROOM.npz --seeds 20

Each seed is a rig with a pattern, noise and a mount's step of its own, in a lab's world but for what it sees beyond
the wall: the room's other walls behind the same air (`room`), or a printed frame where no air moves (`print`). One
JSON line a border and seed, with what was said, and one of counts at the end. Only whole pictures and the product's
own steps.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.experiment.captures import newest_pair
from app.experiment.folder import open_experiment
from app.reconstruct.measure import measure
from app.reconstruct.problem import known_of
from app.simulate.experiment import simulate
from app.simulate.worlds import LAB, Border
from app.volume.scene import RIG_PLACES, RigOptions

BORDERS: tuple[Border, ...] = ("room", "print")


def judged(truth: Path, border: Border, seed: int, camera_px: int, frames: int) -> dict[str, Any]:
    """What a pair of pictures makes of a border."""
    stand_off_m, baseline_m = RIG_PLACES["lab"]
    options = RigOptions(
        camera_px=(camera_px, camera_px * 3 // 4),
        frames=frames,
        stand_off_m=stand_off_m,
        baseline_m=baseline_m,
        pattern_seed=seed,
    )
    # Nothing stands before the wall: a thing that moves would be refused for itself.
    camera = replace(LAB, border=border, world=LAB.world.model_copy(update={"covered": 0.0})).camera(seed)
    with tempfile.TemporaryDirectory() as made:
        experiment = open_experiment(simulate(truth, Path(made) / "e", options, "operator", camera))
        note = measure(newest_pair(experiment), known_of(experiment).scene).notes[0]
    return {
        "room": truth.stem,
        "border": border,
        "seed": seed,
        "camera_px": camera_px,
        "frames": frames,
        "drift_px": camera.drift_px,
        "taken_as_still": "from the border" in note and "may not be still" not in note,
        "refused": "is not still" in note or "may not be still" in note,
        "note": note,
    }


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--camera-px", type=int, default=512)
    parser.add_argument("--frames", type=int, default=100)
    asked = parser.parse_args()
    counts = {}
    for border in BORDERS:
        rows = []
        for seed in range(asked.seeds):
            rows.append(judged(asked.truth, border, seed, asked.camera_px, asked.frames))
            print(json.dumps(rows[-1]), flush=True)
        counts[border] = {name: sum(row[name] for row in rows) for name in ("taken_as_still", "refused")}
    print(json.dumps({"seeds": asked.seeds, "camera_px": asked.camera_px, "counts": counts}))


if __name__ == "__main__":
    main()
