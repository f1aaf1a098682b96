"""A room as a tape measure gives it against its true entries: u and T of both, by `airlens new` and its own steps.

    python -m tests.benchmarks.own_room [--preset standard] [--camera-px 384] [--only true|tape]

The packaged room. The tape is wrong by 1 cm a length, 0.3 K a temperature and 5 % of the supply's speed. One JSON
line each; the last one holds the ratio of the errors.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

from app.capture.burst import take
from app.experiment.folder import Experiment
from app.pipeline import reconstruct
from app.rig.open import air_of, open_camera
from app.setup.experiment import SAMPLE, new_experiment, template
from app.simulate.rehearsal import calibrate_simulated
from app.volume.sample import SAMPLE_ROOM
from app.volume.score import score_experiment
from drivers.burst import CapturePlan, CaptureRole

# What the tape, the thermometer and the flow hood say instead.
TAPE = {
    'room = ["4.1 m", "3 m", "3 m"]': 'room = ["4.11 m", "2.99 m", "3.01 m"]',
    'lower = ["1.2 m", "1.6 m"]': 'lower = ["1.21 m", "1.59 m"]',
    'upper = ["1.8 m", "1.8 m"]': 'upper = ["1.81 m", "1.79 m"]',
    'speed = "0.5 m/s"': 'speed = "0.525 m/s"',
    'temperature = "30 C"': 'temperature = "30.3 C"',
    'lower = ["1.2 m", "0.2 m"]': 'lower = ["1.19 m", "0.21 m"]',
    'upper = ["1.8 m", "0.6 m"]': 'upper = ["1.79 m", "0.61 m"]',
    'temperature = "24.98 C"': 'temperature = "24.7 C"',
}


def entries(kind: str, camera_px: int) -> str:
    """The packaged room's answers, true or as the tape has them."""
    text = template(SAMPLE).replace("width_px = 384", f"width_px = {camera_px}")
    text = text.replace("height_px = 288", f"height_px = {camera_px * 3 // 4}")
    for true, told in TAPE.items() if kind == "tape" else ():
        assert true in text, true
        text = text.replace(true, told)
    return text


def burst(experiment: Experiment, role: CaptureRole) -> None:
    """Take a reference or a flow with the experiment's camera."""
    with open_camera(experiment, air_of(role)) as camera:
        take(camera, experiment, CapturePlan(role, frames=experiment.settings.scene.views[0].frames))


def measured(kind: str, preset: str, camera_px: int, folder: Path) -> dict:
    """New, calibrate, capture, reconstruct, score."""
    began_s = time.process_time()
    made = new_experiment(folder, entries(kind, camera_px), kind)
    calibrate_simulated(made)
    burst(made, "reference")
    burst(made, "flow")
    before_s = time.process_time() - began_s
    reconstruct(folder, preset)
    scores = score_experiment(folder, SAMPLE_ROOM)
    return {
        "entries": kind,
        "preset": preset,
        "camera_px": camera_px,
        "u_rel": scores["u"] and scores["u"]["rel"],
        "T_rms_k": scores["T"]["rms_K"],
        "u_within": scores["u_within"],
        "cpu_before_solve_s": round(before_s, 1),
        "cpu_s": round(time.process_time() - began_s, 1),
        "outcome": scores["outcome"],
    }


def main() -> None:
    """Parse the options, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", default="standard")
    parser.add_argument("--camera-px", type=int, default=384)
    parser.add_argument("--only", choices=("true", "tape"))
    options = parser.parse_args()
    rows = {}
    for kind in (options.only,) if options.only else ("true", "tape"):
        with tempfile.TemporaryDirectory() as scratch:
            rows[kind] = measured(kind, options.preset, options.camera_px, Path(scratch) / "lab")
            print(json.dumps(rows[kind]), flush=True)
    if len(rows) == 2 and rows["true"]["u_rel"]:
        ratio = {name: rows["tape"][name] / rows["true"][name] for name in ("u_rel", "T_rms_k")}
        print(json.dumps({"tape_over_true": ratio}))


if __name__ == "__main__":
    main()
