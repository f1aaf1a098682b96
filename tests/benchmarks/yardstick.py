"""Is a border with the room's air before it doubted, and a truly still one believed? Over seeds.

    python -m tests.benchmarks.yardstick ROOM.npz --seeds 20

Each seed is a rig with a pattern, noise and a mount's step of its own, in a lab's world but for what it sees beyond
the wall: the room's other walls behind the same air (`room`), or a printed frame where no air moves (`print`). With
`--covered 0.05` things stand before so much of the picture, and half of them move. One JSON line a border and seed,
with what was said, how well the motion is known by its own account (`known_px`), and how far it is from what the
seed's printed frame tells (`off_px`; both rms over the wall); and one of counts at the end. Only the product's own
steps.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from app.experiment.captures import newest_pair
from app.experiment.folder import open_experiment
from app.reconstruct.measure import Measurement, measure
from app.reconstruct.problem import known_of
from app.simulate.experiment import simulate
from app.simulate.worlds import LAB, Border
from app.volume.scene import RIG_PLACES, RigOptions
from core.motion import motion_basis

BORDERS: tuple[Border, ...] = ("print", "room")
JUDGED = ("taken_as_still", "refused")
DOUBTS = ("is not still", "moves unlike the rest")


def judged(
    truth: Path, border: Border, seed: int, size: argparse.Namespace
) -> tuple[dict[str, Any], Measurement]:
    """What a pair of pictures makes of a border: in words and numbers, and as it was measured."""
    camera_px, frames = size.camera_px, size.frames
    stand_off_m, baseline_m = RIG_PLACES[size.rig]
    options = RigOptions(
        camera_px=(camera_px, camera_px * 3 // 4),
        frames=frames,
        stand_off_m=stand_off_m,
        baseline_m=baseline_m,
        pattern_seed=seed,
    )
    world = LAB.world.model_copy(update={"covered": size.covered})
    camera = replace(LAB, border=border, world=world).camera(seed)
    with tempfile.TemporaryDirectory() as made:
        experiment = open_experiment(simulate(truth, Path(made) / "e", options, "operator", camera))
        found = measure(newest_pair(experiment), known_of(experiment).scene)
    (note,), (shift,) = found.notes, found.shifts
    row = {
        "room": truth.stem,
        "rig": size.rig,
        "covered": size.covered,
        "border": border,
        "seed": seed,
        "camera_px": camera_px,
        "frames": frames,
        "drift_px": camera.drift_px,
        "taken_as_still": "from the border" in note and not any(words in note for words in DOUBTS),
        "refused": any(words in note for words in DOUBTS),
        "known_px": rms_px(shift.motion.at(shift.centres_px)) if shift.motion else 0.0,
        "note": note,
    }
    return row, found


def rms_px(moved_px: np.ndarray) -> float:
    """How far windows move (rms), by all motions (along the last axis)."""
    return float(np.sqrt(np.mean(np.sum(moved_px**2, axis=tuple(range(1, moved_px.ndim))))))


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--camera-px", type=int, default=512)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--covered", type=float, default=0.0)
    parser.add_argument("--rig", choices=sorted(RIG_PLACES), default="lab")
    asked = parser.parse_args()
    rows = []
    for seed in range(asked.seeds):
        still, told = judged(asked.truth, "print", seed, asked)
        air, read = judged(asked.truth, "room", seed, asked)
        shift = told.shifts[0]
        by_motion = motion_basis(shift.centres_px, told.scene.views[0].camera)
        air["off_px"] = rms_px(by_motion @ (read.drifts_px[0] - told.drifts_px[0]))
        for row in (still, air):
            print(json.dumps(row), flush=True)
            rows.append(row)
    counts = {
        border: {name: sum(row[name] for row in rows if row["border"] == border) for name in JUDGED}
        for border in BORDERS
    }
    print(json.dumps({"seeds": asked.seeds, "camera_px": asked.camera_px, "counts": counts}))


if __name__ == "__main__":
    main()
