"""A view whose pictures another view's camera takes: its projector alone is calibrated, before that camera."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.guide import GuidedCalibration, LivePlan
from app.calibrate.page import figures, measured_model
from app.calibrate.parts import parts_of
from app.calibrate.steps import modelled
from app.calibrate.summary import lines, summary
from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.folder import ExperimentSettings, create_experiment, open_experiment
from app.experiment.rig_settings import BoardSettings, RigSettings, SimulatedCameraSettings
from app.reconstruct.problem import known_of
from app.rig.open import open_stage
from calibration.further_projector import FurtherProjector
from calibration.model import build
from core.geometry import Box, looking_along_y
from core.scene import ProjectedPattern, Scene, View
from tests.calibration.test_further_projector import record_of

BOARD = BoardSettings(columns=5, rows=4, square_m=0.1)


@pytest.fixture
def folder(tmp_path) -> Path:
    """A camera with a projector at its left, and a second one at its right, each stated where it stands."""

    def optics(x_m: float, width_px: int, height_px: int, focal_px: float):
        return looking_along_y(
            position_m=(x_m, 0.0, 1.2), width_px=width_px, height_px=height_px, focal_px=focal_px
        )

    camera = optics(1.5, 320, 240, 400.0)
    left, right = optics(1.2, 256, 192, 220.0), optics(1.8, 256, 192, 220.0)
    views = (
        View(name="eye", camera=camera),
        View(name="second", camera=camera, light=ProjectedPattern(projector=right), camera_of="eye"),
    )
    room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(3.0, 3.0, 2.4))
    scene = Scene(room=room, views=views, light=ProjectedPattern(projector=left))
    rig = RigSettings(camera=SimulatedCameraSettings(seed=3), board=BOARD)
    create_experiment(tmp_path / "room", ExperimentSettings(rig=rig, scene=scene))
    return tmp_path / "room"


def guide(folder: Path, step: StepName) -> GuidedCalibration:
    plan, experiment = LivePlan(step, "second", BOARD.board()), open_experiment(folder)
    return GuidedCalibration(CalibrationFolder(folder), plan, open_stage(experiment, plan.board, view=1))


def with_eye(folder: Path) -> None:
    """Calibrate the camera, by points."""
    scene = open_experiment(folder).settings.scene
    assert isinstance(scene.light, ProjectedPattern)
    seen = record_of(scene.views[0].camera, scene.light.projector, np.random.default_rng(1))
    CalibrationFolder(folder).put_to_use(build(replace(seen, camera="eye")))


def run(*arguments: object):
    return CliRunner().invoke(create_cli(), ["calibrate", *map(str, arguments)])


def test_the_projector_alone_is_fitted_and_goes_where_its_camera_goes(folder):
    with pytest.raises(BadInputError, match="the camera of 'eye', which is not calibrated yet"):
        guide(folder, StepName.projector)
    with_eye(folder)
    calibration = CalibrationFolder(folder)
    eye, guided = calibration.bundle().camera("eye"), guide(folder, StepName.projector)
    for _ in range(3):
        assert guided.take() == ()
    while guided.wanted() is not None:
        guided.skip()
    assert guided.finish()

    bundle = calibration.bundle()
    assert [one.name for one in bundle.cameras] == ["eye"]
    assert bundle.camera("eye") == eye
    lamp = bundle.of("second", False).projector
    assert lamp is not None
    # The true places are 0.3 m apart; the room is not known yet.
    apart_m = np.subtract(lamp.optics.position_m, eye.optics.position_m)
    std_m = np.sqrt(np.diag(lamp.covariance_matrix() + eye.covariance_matrix()))[12:]
    assert np.abs(apart_m - (0.3, 0.0, 0.0)).max() < 5 * std_m.max() < 0.3
    assert "second" not in [name for part in parts_of(open_experiment(folder)) for name in part.lacking]
    # So it stands where the scene says, with the lens that was found.
    stated = open_experiment(folder).settings.scene.views[1].light.projector
    lights = [view.light for view in known_of(open_experiment(folder)).scene.views]
    assert lights[1].projector == replace(
        lamp.optics, position_m=stated.position_m, rotation_rad=stated.rotation_rad
    )
    model = measured_model(calibration, "second")
    assert isinstance(model, FurtherProjector)
    assert len(figures(model, bundle.of("second", False))) == 1
    record = calibration.record("second")
    assert record is not None
    told = lines(summary(modelled(calibration, StepName.projector, record, []), 0.0))
    assert told[0].startswith("projector: rms")
    assert told[1].startswith("camera and projector together: rms")

    # The camera finds the wall, and with it its place in the room: the second projector comes along.
    record = calibration.record("eye")
    assert record is not None
    placed = replace(record.placement, x_m=1.5, z_m=1.2, wall_y_m=3.0)
    level = replace(record.boards[0], name="level")
    moved = calibration.put_to_use(build(replace(record, placement=placed, level=level)))
    after = moved.of("second", False).projector
    assert after is not None
    now_m = np.subtract(after.optics.position_m, moved.camera("eye").optics.position_m)
    assert np.linalg.norm(now_m) == pytest.approx(np.linalg.norm(apart_m), abs=1e-6)
    assert np.linalg.norm(np.subtract(after.optics.position_m, lamp.optics.position_m)) > 0.5


@pytest.mark.parametrize("step", ["camera", "wall", "response"])
def test_what_is_the_cameras_is_calibrated_with_its_own_view(folder, step):
    told = run(step, folder, "--view", "second")
    assert told.exit_code != 0
    assert f"taken by the camera of 'eye', whose step '{step}' serves both" in str(
        told.output or told.exception
    )
    assert f"airlens calibrate {step} room --view eye" in " ".join(told.output.split()) or told.exception
