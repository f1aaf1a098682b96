"""Calibration of a simulated rig against its truth, by hand: one JSON line.

    python -m tests.benchmarks.calibration [--scale 1.0]

Twelve boards (eight under Gray code) and an oblique wall at 3 m, single frames of a 10-bit camera.
"""

import argparse
import json
import time

import numpy as np

import tests.calibration.test_model as practice_rig
from tests.calibration.practice import rig


def main() -> None:
    """Render, calibrate, compare, print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--scale", type=float, default=1.0, help="1.0: camera 1280 x 1024, panel 1280 x 800.")
    practice_rig.SCALE = parser.parse_args().scale
    began_s = time.process_time()
    practice_rig.practised()
    rendered_s = time.process_time()
    model = practice_rig.practised_model()
    line: dict[str, object] = {
        "scale": practice_rig.SCALE,
        "render_and_detect_cpu_s": rendered_s - began_s,
        "fit_cpu_s": time.process_time() - rendered_s,
    }
    axes, mark_m = practice_rig.true_world(), practice_rig.MARK_M
    both = (model.camera_optics, model.projector_optics)
    for name, found, truth in zip(("camera", "projector"), both, rig(practice_rig.SCALE), strict=True):
        if found is None:
            continue
        position_m = axes @ (np.array(truth.position_m) - mark_m) + mark_m
        off_m = np.array(found.optics.position_m) - position_m
        line[name] = {
            "focal_error_percent": 100 * (found.optics.focal_px[0] / truth.focal_px[0] - 1),
            "position_error_mm": 1e3 * float(np.linalg.norm(off_m)),
            "position_std_mm": (1e3 * np.sqrt(np.diag(found.covariance_matrix()))[12:]).tolist(),
            "rotation_error_deg": practice_rig.angle_deg(found.optics.rotation, truth.rotation @ axes.T),
            "rms_px": found.quality.reprojection_rms_px,
        }
    if model.plane is not None:
        # The wall in the camera's frame: distance and direction against the truth.
        camera, sheet = rig(practice_rig.SCALE)[0], practice_rig.wall()
        normal = camera.rotation @ sheet.world_from_sheet[:, 2]
        offset_m = sheet.world_from_sheet[:, 2] @ (sheet.position_m - np.array(camera.position_m))
        line["wall"] = {
            "offset_error_mm": 1e3 * (model.plane.offset_m - float(offset_m)),
            "angle_error_deg": float(np.degrees(np.arccos(min(abs(normal @ model.plane.normal), 1.0)))),
            "flatness_rms_mm": 1e3 * model.plane.flatness_rms_m,
        }
    print(json.dumps(line))


if __name__ == "__main__":
    main()
