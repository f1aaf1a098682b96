"""Calibration from folders of pictures, as an operator runs it: small panel, small pictures, real files."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from app.calibrate.folder import CalibrationFolder
from app.calibrate.page import figures, measured_model
from app.calibrate.steps import model_of
from app.cli import create_cli
from calibration.board import Chessboard
from calibration.bundle import from_json
from calibration.errors import CalibrationError
from calibration.graycode import patterns
from calibration.record import Record, SeenBoard, rows_of
from calibration.simulated_pictures import look
from tests.calibration.practice import STANDS, exposed, rig, standing

SCALE = 0.4
BOARD = Chessboard(9, 6, 0.08)
PANEL = (512, 320)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory) -> Path:
    """Four Gray-code sequences on a board, in the layout capture_0..3/graycode_00.. (white, black last)."""
    folder = tmp_path_factory.mktemp("pictures")
    camera, projector = rig(SCALE)
    rng = np.random.default_rng(11)
    shown = patterns(*PANEL).astype(np.float32) / 255
    assert (projector.width_px, projector.height_px) == PANEL
    for number, stand in enumerate(STANDS[1:5]):
        seen = look(camera, (standing(BOARD, *stand),), projector)
        place = folder / f"capture_{number}"
        place.mkdir()
        for frame, panel in enumerate(shown):
            picture = exposed(seen.expose(panel, 0.02), rng, bits=8)
            cv2.imwrite(str(place / f"graycode_{frame:02d}.png"), picture.astype(np.uint8))
    return folder


def run(*arguments: object):
    return CliRunner().invoke(create_cli(), ["calibrate", *map(str, arguments)])


def projector(folder: Path, images: Path):
    options = ["--grid", "9x6", "--square", "80mm", "--projector-px", "512x320", "--json"]
    return run("projector", folder, "--images", images, *options)


def test_camera_then_projector_from_a_folder(pictures, tmp_path):
    camera = run("camera", tmp_path, "--images", pictures, "--grid", "9x6", "--square", "0.08", "--json")
    assert camera.exit_code == 0, camera.output
    seen = json.loads(camera.stdout)
    assert seen["boards"] == 4
    assert seen["camera"]["views"][0]["name"] == "capture_0/graycode_36.png"
    assert seen["camera"]["rms_px"] < 0.15

    both = projector(tmp_path, pictures)
    assert both.exit_code == 0, both.output
    found = json.loads(both.stdout)
    true_camera, true_projector = rig(SCALE)
    # Four views of a small picture at 8 bits: half a percent.
    assert found["camera"]["focal_px"][0] == pytest.approx(true_camera.focal_px[0], rel=5e-3)
    assert found["projector"]["focal_px"][0] == pytest.approx(true_projector.focal_px[0], rel=5e-3)
    assert found["projector"]["principal_px"][1] > PANEL[1]
    baseline = np.linalg.norm(np.subtract(true_camera.position_m, true_projector.position_m))
    assert found["stereo"]["baseline_m"] == pytest.approx(baseline, rel=0.02)
    # The pictures are the same ones: still four boards, now lit.
    assert found["boards"] == 4
    bundle = from_json((tmp_path / "calibration" / "bundle.json").read_text())
    assert bundle.projector is not None
    assert bundle.projector.cross_covariance is not None
    assert len(bundle.images) == 4

    # What the report shows of it; a calibration that was given, not measured, has nothing to show.
    model = measured_model(CalibrationFolder(tmp_path))
    assert model is not None
    assert [title.split(":")[0] for title, _ in figures(model, bundle)] == ["Camera", "Projector"]
    assert measured_model(CalibrationFolder(tmp_path / "elsewhere")) is None

    page = run("page", tmp_path)
    assert page.exit_code == 0, page.output
    written = (tmp_path / "calibration" / "calibration.html").read_text()
    # Two figures without a wall: the camera's and the projector's residuals.
    assert written.count("data:image/png;base64,") == 2
    assert "4 views; take 8 to 20" in written


def test_missing_swapped_and_odd_frames_are_named_and_the_rest_is_kept(pictures, tmp_path):
    images = tmp_path / "images"
    shutil.copytree(pictures, images)
    (images / "capture_1" / "graycode_17.png").unlink()
    small = cv2.imread(str(images / "capture_2" / "graycode_05.png"), cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(str(images / "capture_2" / "graycode_05.png"), small[:-8])

    done = projector(tmp_path / "experiment", images)

    assert done.exit_code == 1
    content = json.loads(done.stdout)
    assert not content["complete"]
    assert any("capture_1" in i and "missing: 17" in i and "38" in i for i in content["issues"])
    assert any("capture_2" in i and "graycode_05.png" in i and "size" in i for i in content["issues"])
    assert any("2 usable board views; expected at least 3" in i for i in content["issues"])
    # What was found waits in the record for the views to be retaken.
    assert content["boards"] == 2
    again = projector(tmp_path / "experiment", pictures)
    assert again.exit_code == 0
    assert json.loads(again.stdout)["boards"] == 4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--grid", "nine", "--square", "75mm"], "two whole numbers such as 9x7"),
        (["--grid", "9x6", "--square", "75 miles"], "a length such as 75mm"),
        (["--grid", "9x6", "--square", "75"], "75 mm is 0.075"),
    ],
)
def test_bad_options_are_explained(options, said, pictures, tmp_path):
    done = run("camera", tmp_path, "--images", pictures, *options)

    assert done.exit_code != 0
    assert said in str(done.exception)


def test_a_folder_without_pictures_and_a_broken_picture_are_explained(tmp_path):
    done = run("camera", tmp_path, "--images", tmp_path, "--grid", "9x6", "--square", "75mm")
    assert "holds no picture" in str(done.exception)

    (tmp_path / "view_1.png").write_bytes(b"not a picture")
    done = run("camera", tmp_path, "--images", tmp_path, "--grid", "9x6", "--square", "75mm")
    assert "view_1.png" in str(done.exception)
    assert "cut short" in str(done.exception)


def test_views_that_no_solver_can_use_are_no_crash():
    points = rows_of(BOARD.points_m)
    # Every corner of the board in one place.
    boards = tuple(SeenBoard(str(n), str(n), points, rows_of(np.full((54, 2), 100.0))) for n in range(3))
    with pytest.raises(CalibrationError, match="Retake the newest views"):
        model_of(Record("camera", (640, 512), boards=boards))
