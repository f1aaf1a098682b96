"""`airlens calibrate together` on a simulated rig of two cameras, and the same through the service's door."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.calibrate.folder import CalibrationFolder
from app.calibrate.parts import ties_of
from app.cli import create_cli
from app.experiment.calibration import read_bundle
from app.experiment.folder import ExperimentSettings, create_experiment, open_experiment
from app.experiment.rig_settings import BoardSettings, RigSettings, SimulatedCameraSettings
from app.whereabouts import whereabouts
from calibration.model import build
from core.geometry import Box
from core.scene import FixedTexture, Scene, View
from tests.app.api.conftest import live as service
from tests.calibration.test_together import ROOM_M, WALLS, Rig, rig

__all__ = ["service"]
# Pictures of 384 x 307 px show squares of 0.15 m at 4 m as 14 px.
SCALE = 0.3


def smaller(made: Rig) -> Rig:
    """The rig in smaller pictures."""

    def optics(one):
        (fx, fy), (cx, cy) = one.focal_px, one.principal_px
        return replace(
            one,
            width_px=int(one.width_px * SCALE),
            height_px=int(one.height_px * SCALE),
            focal_px=(fx * SCALE, fy * SCALE),
            principal_px=(cx * SCALE, cy * SCALE),
        )

    def seen(board):
        return replace(board, camera_px=tuple((u * SCALE, v * SCALE) for u, v in board.camera_px))

    def record(one):
        boards = tuple(seen(board) for board in one.boards)
        size = tuple(int(n * SCALE) for n in one.camera_size_px)
        return replace(one, camera_size_px=size, boards=boards, level=seen(one.level))

    one, other = made.truth
    a, b = made.records
    return replace(made, truth=(optics(one), optics(other)), records=(record(a), record(b)))


@pytest.fixture(scope="module")
def made() -> Rig:
    return smaller(rig(11))


def experiment(folder: Path, made: Rig) -> Path:
    """Two cameras that stand where they are stated, each calibrated alone by boards of its own."""
    views = tuple(
        View(name=name, camera=optics, wall=wall)
        for name, optics, wall in zip("ab", made.truth, WALLS, strict=True)
    )
    x, y, z = map(float, ROOM_M)
    scene = Scene(room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(x, y, z)), views=views, light=FixedTexture())
    board = BoardSettings(columns=6, rows=5, square_m=0.15)
    settings = RigSettings(camera=SimulatedCameraSettings(seed=2), board=board)
    create_experiment(folder, ExperimentSettings(rig=settings, scene=scene))
    for record in made.records:
        CalibrationFolder(folder).put_to_use(build(record))
    return folder


def run(*arguments: object):
    return CliRunner().invoke(create_cli(), ["calibrate", "together", *map(str, arguments)])


def test_cameras_that_share_nothing_are_refused_and_status_says_what_is_missing(tmp_path, made):
    folder = experiment(tmp_path / "apart", made)

    refused = run(folder, "--only-adjust")

    assert refused.exit_code != 0
    assert "Nothing that more than one sees ties 'a' and 'b'" in str(refused.exception)
    assert "each view by itself" in whereabouts(folder).has["calibration"]
    told = run(tmp_path / "apart", "--images", tmp_path)
    assert "0 of the folders a, b; expected one for each camera" in str(told.exception)


def test_one_view_or_none_calibrated_from_pictures_is_refused(tmp_path, made):
    folder = experiment(tmp_path / "given", made)
    shutil.rmtree(folder / "calibration")
    refused = run(folder, "--only-adjust")
    assert "'a', 'b' have no camera calibrated from pictures" in str(refused.exception)


@pytest.fixture(scope="module")
def tied(tmp_path_factory, made) -> tuple[Path, dict]:
    """Three places of the board, live: the simulated rig holds it where both cameras see it."""
    folder = experiment(tmp_path_factory.mktemp("together") / "experiment", made)
    done = run(folder, "--places", 3, "--json")
    assert done.exit_code == 0, (done.output, done.exception)
    return folder, json.loads(done.stdout)


def test_two_cameras_see_a_board_at_once_and_are_tied_to_a_millimetre(tied, made):
    folder, content = tied
    bundle = read_bundle(folder)
    assert bundle is not None
    assert bundle.joint is not None
    assert content["boards"] == bundle.joint.boards == 3
    now = bundle.camera("a").optics, bundle.camera("b").optics
    error = made.relative_error(now)
    # A third of the full size, three places: some three times the deviations of six places at full size.
    assert np.linalg.norm(error[3:]) < 0.006
    assert np.linalg.norm(error[:3]) < 0.002
    (pair,) = content["pairs"]
    apart_m = np.linalg.norm(np.subtract(made.truth[1].position_m, made.truth[0].position_m))
    assert abs(pair["apart_m"] - apart_m) < 4 * pair["apart_std_m"]
    assert "a, b adjusted together by 3 boards" in whereabouts(folder).has["calibration"]


def test_pictures_that_are_there_come_to_the_same(tied, tmp_path):
    folder, content = tied
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    (copy / "calibration" / "shared.json").unlink()
    again = run(copy, "--images", copy / "calibration" / "live-together", "--json")
    assert json.loads(again.stdout)["pairs"] == content["pairs"]


def test_a_camera_that_is_calibrated_anew_stands_by_itself_again(tied, tmp_path, made):
    folder, _ = tied
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    CalibrationFolder(copy).put_to_use(build(made.records[1]))
    found = ties_of(open_experiment(copy))
    assert found is not None
    assert not found.joint
    assert run(copy, "--discard").exit_code == 0
    assert not (copy / "calibration" / "live-together").exists()


def test_the_service_adjusts_what_is_there_and_says_so(tied, service):
    folder, content = tied
    shutil.copytree(folder, service.config.data_root / "experiments" / "two")
    with service.client() as http:
        before = http.get("/api/experiments/two/calibration").json()
        found = http.post("/api/experiments/two/calibration/together", json={"tape_std_m": 0.005})
        assert found.status_code == 201, found.text
        refused = http.post("/api/experiments/two/calibration/together", json={"tape_std_m": 0})
    (item,) = [one for one in before["items"] if one["name"] == "views together"]
    assert item["state"] == "measured"
    assert found.json()["pairs"] == content["pairs"]
    assert refused.status_code == 422
