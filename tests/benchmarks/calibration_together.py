"""Two cameras of one simulated room, calibrated each alone and then together, against the truth; by hand.

    python -m tests.benchmarks.calibration_together [--seeds 6] [--places 6] [--scale 0.5]

By the commands of a user: calibrate camera and wall of both views, then calibrate together. Both walls' and cameras'
places are as wrong as a tape reads (5 mm). One JSON line a seed, and one of all. Some 30 CPU seconds a seed.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from app.cli import create_cli
from app.experiment.calibration import read_bundle
from app.experiment.folder import ExperimentSettings, create_experiment
from app.experiment.rig_settings import BoardSettings, RigSettings, SimulatedCameraSettings
from calibration.bundle import Bundle
from calibration.world import difference
from core.geometry import Box, Optics, face_of
from core.scene import FixedTexture, Scene, View
from tests.calibration.test_together import (
    ROOM_M,
    STATED,
    WALLS,
    Rig,
    camera,
    normalised,
    relative_covariance,
)

NAMES = ("a", "b")
_POSES = np.r_[9:15, 24:30]


def main() -> None:
    """Calibrate, compare, print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--places", type=int, default=6)
    parser.add_argument("--scale", type=float, default=0.5)
    asked = parser.parse_args()
    rows = []
    for seed in range(asked.seeds):
        with tempfile.TemporaryDirectory() as name:
            rows.append(_row(Path(name) / "experiment", seed, asked.places, asked.scale))
        print(json.dumps(rows[-1]), flush=True)
    print(json.dumps(_all(rows) | {"seeds": asked.seeds, "places": asked.places, "scale": asked.scale}))


def _all(rows: list[dict[str, float]]) -> dict[str, float]:
    """Rms over the seeds; the normalised errors are means of squares, 1 where the covariance is honest."""
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0] if name != "seed"}
    return {
        name: float(np.mean(values) if name.startswith("normalised") else np.sqrt(np.mean(values**2)))
        for name, values in columns.items()
    }


def _row(folder: Path, seed: int, places: int, scale: float) -> dict[str, float]:
    truth = _experiment(folder, seed, scale)
    rng = np.random.default_rng(1000 + seed)
    for name, wall, optics in zip(NAMES, WALLS, truth, strict=True):
        _run("camera", folder, "--view", name)
        at_m = np.array(optics.position_m) + STATED.tape_std_m * rng.standard_normal(3)
        axis = face_of(wall).axis
        across = ",".join(str(at_m[n]) for n in range(3) if n != axis)
        wall_m = ROOM_M[axis] + STATED.tape_std_m * rng.standard_normal()
        _run("wall", folder, "--view", name, "--camera-at", across, "--wall-y", wall_m)
    made = Rig(truth, (), ())
    alone = made.relative_error(_found(read_bundle(folder)))
    _run("together", folder, "--places", places)
    bundle = read_bundle(folder)
    assert bundle is not None
    assert bundle.joint is not None
    now = _found(bundle)
    error = made.relative_error(now)
    off = np.concatenate([difference(one, true)[9:] for one, true in zip(now, truth, strict=True)])
    whole = bundle.joint.covariance_of(*NAMES)
    return {
        "seed": seed,
        "alone_mm": 1e3 * float(np.linalg.norm(alone[3:])),
        "alone_mrad": 1e3 * float(np.linalg.norm(alone[:3])),
        "together_mm": 1e3 * float(np.linalg.norm(error[3:])),
        "together_mrad": 1e3 * float(np.linalg.norm(error[:3])),
        "normalised_relative": normalised(error, relative_covariance(now, whole)),
        "normalised_in_room": normalised(off, whole[np.ix_(_POSES, _POSES)]),
    }


def _found(bundle: Bundle | None) -> tuple[Optics, Optics]:
    assert bundle is not None
    one, other = (bundle.camera(name).optics for name in NAMES)
    return one, other


def _experiment(folder: Path, seed: int, scale: float) -> tuple[Optics, Optics]:
    rng = np.random.default_rng(seed)
    # The guide asks for the same views of every camera, and what pixels do to corners there is the same for cameras
    # that are alike: each seed has a lens of its own, or all of them would share one error.
    scales = scale * np.random.default_rng(2000 + seed).uniform(0.9, 1.1, 2)
    one, other = (_smaller(camera(wall, rng), own) for wall, own in zip(WALLS, scales, strict=True))
    x, y, z = map(float, ROOM_M)
    pairs = zip(NAMES, (one, other), WALLS, strict=True)
    views = tuple(View(name=name, camera=optics, wall=wall) for name, optics, wall in pairs)
    scene = Scene(room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(x, y, z)), views=views, light=FixedTexture())
    board = BoardSettings(columns=9, rows=6, square_m=0.1)
    rig = RigSettings(camera=SimulatedCameraSettings(seed=seed), board=board)
    create_experiment(folder, ExperimentSettings(rig=rig, scene=scene))
    return one, other


def _smaller(optics: Optics, scale: float) -> Optics:
    (fx, fy), (cx, cy) = optics.focal_px, optics.principal_px
    width, height = int(optics.width_px * scale), int(optics.height_px * scale)
    return replace(
        optics,
        width_px=width,
        height_px=height,
        focal_px=(fx * scale, fy * scale),
        principal_px=(cx * scale, cy * scale),
    )


def _run(*arguments: object) -> None:
    done = CliRunner().invoke(create_cli(), ["calibrate", *map(str, arguments)])
    assert done.exit_code == 0, (done.output, done.exception)


if __name__ == "__main__":
    main()
