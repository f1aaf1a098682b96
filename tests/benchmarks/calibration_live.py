"""The guided calibration of a simulated rig at full size against its truth, by hand: one JSON line.

    python -m tests.benchmarks.calibration_live [--scale 1.0]

The four commands of the command line; some three CPU minutes at full size (camera 1280 x 1024, 10 bit).
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from calibration.bundle import from_json
from tests.app.calibrate.test_terminal import NOISE, angle_deg, experiment, run


def main() -> None:
    """Calibrate, compare, print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--scale", type=float, default=1.0)
    scale = parser.parse_args().scale
    line: dict[str, object] = {"scale": scale}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "experiment"
        truths = experiment(folder, scale)
        for step in ("camera", "projector", "wall", "response"):
            began_s = time.process_time()
            done = run(step, folder, *([] if step == "camera" else ["--settle-s", 0]))
            assert done.exit_code == 0, done.output
            line[f"{step}_cpu_s"] = round(time.process_time() - began_s, 1)
        bundle = from_json((folder / "calibration" / "bundle.json").read_text())
    assert bundle.projector is not None
    for found, truth in zip((bundle.camera(), bundle.projector), truths, strict=True):
        off_m = np.subtract(found.optics.position_m, truth.position_m)
        line[found.name] = {
            "focal_error_percent": 100 * (found.optics.focal_px[0] / truth.focal_px[0] - 1),
            "position_error_mm": 1e3 * float(np.linalg.norm(off_m)),
            "rotation_error_deg": angle_deg(found.optics.rotation, truth.rotation),
            "rms_px": found.quality.reprojection_rms_px,
        }
    response = bundle.response("camera")
    assert response is not None
    gain = (2**NOISE.bits - 1 - NOISE.dark_counts) / NOISE.full_well_e
    line["response"] = {
        "gain_error_percent": 100 * (response.gain_counts_per_e / gain - 1),
        "read_noise_error_percent": 100 * (response.read_noise_e / NOISE.read_noise_e - 1),
    }
    print(json.dumps(line))


if __name__ == "__main__":
    main()
