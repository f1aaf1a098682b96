"""The guided calibration on a simulated rig: 3 m, lens distortion, an oblique wall, a shifted projector."""

import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.guide import GuidedCalibration, LivePlan
from app.cli import create_cli
from app.experiment.folder import ExperimentSettings, create_experiment, open_experiment, save_settings
from app.experiment.rig_settings import BoardSettings, RigSettings, SimulatedCameraSettings
from app.rig.stage import UnopenedStage
from calibration.bundle import from_json
from calibration.guide import PROJECTOR_PLAN
from core.geometry import Box, Optics
from core.scene import CameraNoise, FixedTexture, ProjectedPattern, Scene, View
from drivers.simulated import SimulatedDisplay
from tests.calibration.practice import rig, turned

AIRLENS = [sys.executable, "-c", "from app.cli import main; main()", "calibrate"]
NOISE = CameraNoise(full_well_e=10_000.0, read_noise_e=5.0, dark_counts=16.0, bits=10)
# The board is 0.6 x 0.4 m between its outer corners; the wall is 3 m away and 8 degrees oblique.
BOARD = BoardSettings(columns=9, rows=6, square_m=0.075)


def oblique_rig(scale: float) -> tuple[Optics, Optics]:
    """The practice rig, both turned by 8 degrees against a wall that is y = 3 m."""
    camera, projector = (turned(one, (0.0, 0.14, 0.0)) for one in rig(scale))
    return camera, projector


def experiment(folder: Path, scale: float, noise: CameraNoise = NOISE) -> tuple[Optics, Optics]:
    camera, projector = oblique_rig(scale)
    scene = Scene(
        room=Box(lower_m=(-2.0, 1.0, 0.0), upper_m=(2.0, 3.0, 2.4)),
        views=(View(camera=camera, noise=noise, frames=4),),
        light=ProjectedPattern(projector=projector),
    )
    rig_settings = RigSettings(camera=SimulatedCameraSettings(seed=3), board=BOARD)
    create_experiment(folder, ExperimentSettings(rig=rig_settings, scene=scene))
    return camera, projector


def run(*arguments: object):
    return CliRunner().invoke(create_cli(), ["calibrate", *map(str, arguments)])


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1))))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory) -> tuple[Path, Optics, Optics]:
    """All four steps at 0.4 of the full size, as an operator would run them."""
    folder = tmp_path_factory.mktemp("live") / "experiment"
    camera, projector = experiment(folder, 0.4)
    for step in ("camera", "projector", "wall", "response"):
        done = run(step, folder, "--minutes-on", 45, *([] if step == "camera" else ["--settle-s", 0]))
        assert done.exit_code == 0, (step, done.output, done.exception)
    return folder, camera, projector


def test_a_simulated_rig_is_calibrated_live_to_its_truth(calibrated):
    folder, camera, projector = calibrated
    bundle = from_json((folder / "calibration" / "bundle.json").read_text())
    assert bundle.projector is not None
    assert bundle.wall is not None
    for found, truth in ((bundle.camera(), camera), (bundle.projector, projector)):
        # Corners are found to 0.03 px whatever the picture's size: full size is two and a half times as good.
        np.testing.assert_allclose(found.optics.focal_px, truth.focal_px, rtol=2.5e-3)
        assert angle_deg(found.optics.rotation, truth.rotation) < 0.05
        assert np.linalg.norm(np.subtract(found.optics.position_m, truth.position_m)) < 2.5e-3
    assert bundle.wall.point_m[1] == pytest.approx(3.0, abs=1e-3)


def test_the_response_is_the_cameras_own_and_the_conditions_are_noted(calibrated):
    folder, _, _ = calibrated
    bundle = from_json((folder / "calibration" / "bundle.json").read_text())
    found = bundle.response("camera")
    assert found is not None
    # 1007 counts for 10,000 electrons.
    assert found.gain_counts_per_e == pytest.approx(0.1007, rel=5e-3)
    assert found.full_well_e == pytest.approx(NOISE.full_well_e, rel=5e-3)
    assert found.nonlinearity < 5e-3
    assert found.read_noise_e == pytest.approx(NOISE.read_noise_e, rel=0.03)
    assert bundle.projector_response is not None
    assert bundle.projector_response.gamma == pytest.approx(1.0, abs=5e-3)
    # Told by option, and by the scene's air.
    assert bundle.minutes_on == 45
    assert bundle.ambient_temperature_k == pytest.approx(293.15, abs=5)


def test_a_view_that_is_forgotten_is_asked_for_again_and_replaced(calibrated, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(calibrated[0], folder)
    before = CalibrationFolder(folder).record("camera")
    assert before is not None

    done = run("camera", folder, "--retake", "view_03.png", "--json")

    assert "lower left" in done.stderr
    assert done.stderr.count("Show the board") == 1
    content = json.loads(done.stdout)
    assert content["boards"] == len(before.boards)
    names = [view["name"] for view in content["camera"]["views"]]
    assert "view_03.png" not in names
    assert "view_12.png" in names
    missing = run("camera", folder, "--retake", "view_99.png")
    assert missing.exit_code != 0
    assert "no view 'view_99.png'; known are" in str(missing.exception)


def test_a_killed_session_goes_on_where_it_was(tmp_path):
    folder = tmp_path / "killed"
    experiment(folder, 0.25)
    taken = folder / "calibration" / "live-camera"
    command = [*AIRLENS, "camera", str(folder)]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    until_s = time.monotonic() + 200
    while len(list(taken.glob("view_*.png"))) < 4 and time.monotonic() < until_s:
        time.sleep(0.02)
    process.kill()
    process.wait()
    before = {p.name: p.read_bytes() for p in taken.glob("view_*.png")}
    assert len(before) >= 4

    done = run("camera", folder, "--json")

    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["boards"] == 12
    assert {n: (taken / n).read_bytes() for n in before} == before


def test_half_a_sequence_is_taken_anew_and_ctrl_c_keeps_the_whole_ones(tmp_path):
    folder = tmp_path / "stopped"
    experiment(folder, 0.25)
    places = folder / "calibration" / "live-projector"
    command = [*AIRLENS, "projector", str(folder), "--settle-s", "0.1"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    until_s = time.monotonic() + 200
    while len(list(places.glob("place_01/*.png"))) < 3 and time.monotonic() < until_s:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=200)[1]

    assert process.returncode == 1
    assert "goes on from there" in said
    assert "1 usable board views; expected at least 3" in said or "not complete" in said
    record = CalibrationFolder(folder).collected("camera")
    assert record is not None
    assert [board.name for board in record.boards] == ["place_00/graycode"]
    assert 0 < len(list(places.glob("place_01/*.png"))) < 38
    again = GuidedCalibration(
        CalibrationFolder(folder),
        LivePlan(StepName.projector, board=BOARD.board()),
        UnopenedStage(SimulatedDisplay(200, 320), (320, 200)),
    )
    again.resume()
    assert not (places / "place_01").exists()
    wanted = again.wanted()
    assert wanted is not None
    assert wanted.view == PROJECTOR_PLAN[1]


def test_steps_out_of_order_and_without_a_board_are_explained(tmp_path):
    folder = tmp_path / "order"
    experiment(folder, 0.25)
    assert "no calibrated camera yet" in str(run("wall", folder).exception)
    assert "There is no" in str(
        run("camera", tmp_path / "none", "--grid", "9x6", "--square", "0.1").exception
    )


def test_a_printed_wall_without_a_board_is_refused_and_found_by_one(tmp_path):
    folder = tmp_path / "printed"
    experiment(folder, 0.25)
    settings = open_experiment(folder).settings
    scene = replace(settings.scene, light=FixedTexture())
    rig_settings = settings.rig.model_copy(update={"board": None})
    save_settings(folder, settings.model_copy(update={"scene": scene, "rig": rig_settings}))
    board = ("--grid", "9x6", "--square", "75mm")
    assert run("camera", folder, *board).exit_code == 0
    assert "The board is not known" in str(run("wall", folder).exception)
    done = run("wall", folder, *board)
    assert done.exit_code == 0, done.output
    assert from_json((folder / "calibration" / "bundle.json").read_text()).wall is not None
