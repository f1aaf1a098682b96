"""How long to average: what a plan says beforehand, beside the snapshots of a moving room.

    python -m tests.benchmarks.averaging TRUTH.npz SNAPSHOTS.npz [--seconds 6 12 24 48]

The plan knows what `simulate --information operator` states. Of the snapshots, `found_k` is the rms over the room of
means over so many seconds less the mean of all of them, made larger for that mean's own error. `times_longer` is the
plan's time for the error that the snapshots have, over the time that it truly takes. One JSON line a time.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from app.volume.file import read_volume
from app.volume.scene import RigOptions, room_scene
from core.plan.expected import expected_flow
from core.problem import Problem


def main() -> None:
    """Print one row for each time that was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("truth", type=Path)
    parser.add_argument("snapshots", type=Path)
    parser.add_argument("--seconds", type=float, nargs="+", default=[6.0, 12.0, 24.0, 48.0])
    asked = parser.parse_args()
    scene = room_scene(read_volume(asked.truth), RigOptions(), "operator")
    air = expected_flow(Problem(scene, ())).fluctuation
    assert air is not None
    with np.load(asked.snapshots) as file:
        temperature_k, time_s = file["T"].astype(np.float64), file["time_s"]
    step_s, whole_k = float(np.median(np.diff(time_s))), temperature_k.mean(axis=0)
    recorded_s = step_s * len(time_s)
    for seconds in asked.seconds:
        count = max(1, round(seconds / step_s))
        starts = range(0, len(time_s) - count + 1, count)
        apart_k = [temperature_k[start : start + count].mean(axis=0) - whole_k for start in starts]
        # The mean of a part and that of the whole share the part.
        found_k = float(np.sqrt(np.mean(np.square(apart_k)) / (1.0 - seconds / recorded_s)))
        row = {
            "truth": asked.truth.stem,
            "averaged_s": seconds,
            "planned_k": air.error_k(seconds),
            "found_k": found_k,
            "times_longer": air.seconds_for(found_k) / seconds,
            "planned_fluctuation_k": air.std_k,
            "found_fluctuation_k": float(np.sqrt(temperature_k.var(axis=0).mean())),
        }
        print(
            json.dumps({name: round(v, 4) if isinstance(v, float) else v for name, v in row.items()}),
            flush=True,
        )


if __name__ == "__main__":
    main()
