"""Two cameras, each calibrated by the app's own commands, captured and reconstructed."""

import math
import shlex
from pathlib import Path

import numpy as np
import pytest

from app.calibrate.folder import CalibrationFolder
from app.calibrate.parts import is_calibrated, parts_of
from app.experiment.folder import bundle_path, open_experiment
from app.pipeline import reconstruct
from app.volume.score import score_experiment
from app.whereabouts import whereabouts
from core.geometry import Optics
from tests.app.capture.test_views import run
from tests.rooms import ROOM, state_grid

BOARD = ("--grid", "9x6", "--square", "120mm")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A room before two cameras, of which nobody has calibrated one; nothing is captured."""
    made = tmp_path_factory.mktemp("lab") / "room"
    options = ("--views", "y,x", "--camera-px", 256, "--world", "ideal", "--rig", "lab", "--frames", 30)
    assert run("simulate", made, "--truth", ROOM, *options).exit_code == 0
    bundle_path(made).unlink()
    return state_grid(made, 16)


def next_of(folder: Path) -> list[str]:
    command = whereabouts(folder).next.command
    assert command.startswith("airlens ")
    return shlex.split(command)[1:]


def apart(found: Optics, true: Optics) -> tuple[float, float]:
    """Metres, and radians, between two optics."""
    turned = found.rotation @ true.rotation.T
    return math.dist(found.position_m, true.position_m), math.acos(min(1.0, (np.trace(turned) - 1) / 2))


@pytest.mark.timeout(900)
def test_each_camera_is_calibrated_by_its_name_and_both_give_the_temperature(folder):
    stated = score_experiment(folder, ROOM, reconstruct(folder, "draft").folder)["T"]["rms_K"]
    views = open_experiment(folder).settings.scene.views
    steps = []
    while (command := next_of(folder))[0] == "calibrate":
        steps.append((command[1], command[4]))
        done = run(*command, *BOARD)
        assert done.exit_code == 0, done.output
    assert steps == [
        ("camera", "camera"),
        ("camera", "camera at x_max"),
        ("wall", "camera"),
        ("wall", "camera at x_max"),
    ]
    experiment = open_experiment(folder)
    assert is_calibrated(parts_of(experiment))
    bundle = CalibrationFolder(folder).bundle()
    for number, view in enumerate(views):
        metres, radians = apart(bundle.camera(view.name).optics, view.camera)
        # Twelve boards in pictures of 256 px tell a distance of 4 m to two centimetres.
        assert metres < 0.05, view.name
        assert radians < 0.005, view.name
        own = bundle.of(view.name, number == 0)
        assert own.wall is not None
        assert own.wall.quality.source == "measured"
        axis = "xyz".index(view.wall[0])
        assert abs(own.wall.normal[axis]) == pytest.approx(1.0, abs=1e-3)
        assert own.wall.point_m[axis] == pytest.approx(experiment.settings.scene.room.upper_m[axis], abs=1e-6)

    for role in ("reference", "flow"):
        assert run("capture", role, folder, "--frames", 30).exit_code == 0
    found = score_experiment(folder, ROOM, reconstruct(folder, "draft").folder)["T"]["rms_K"]
    print(f"T rms: optics as stated {stated:.3f} K, as calibrated {found:.3f} K")
    assert found < stated + 0.1


def test_the_second_cameras_response_is_its_own(folder):
    done = run("calibrate", "response", folder, "--view", "camera at x_max", "--response-frames", 4)
    assert done.exit_code == 0, done.output
    bundle = CalibrationFolder(folder).bundle()
    assert bundle.response("camera at x_max") is not None
    assert bundle.response("camera") is None


def test_an_unknown_view_is_named_with_those_that_are(folder):
    unnamed = run("calibrate", "camera", folder, *BOARD)
    assert "has 2 views: 'camera', 'camera at x_max'" in str(unnamed.exception)
    for step in ("camera", "projector", "wall", "response", "page"):
        unknown = run("calibrate", step, folder, "--view", "left")
        assert "no view 'left'; its views are 'camera', 'camera at x_max'" in str(unknown.exception), step
