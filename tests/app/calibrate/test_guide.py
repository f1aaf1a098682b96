"""A step that is not complete changes nothing that is used; it is discarded, or put to use when it is complete."""

import pytest

from app.calibrate.folder import CalibrationFolder, StepName
from app.calibrate.guide import GuidedCalibration, LivePlan
from app.calibrate.page import measured_model
from app.calibrate.parts import is_calibrated, parts_of
from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.rig.open import open_stage
from app.simulate.rehearsal import Rehearsal, calibrate_simulated, rehearse
from calibration.guide import CAMERA_PLAN


@pytest.fixture
def experiment(tmp_path) -> Experiment:
    return rehearse(tmp_path, Rehearsal(camera_px=256))


def guide_of(experiment: Experiment, step: StepName = StepName.camera) -> GuidedCalibration:
    board = experiment.settings.rig.board
    assert board is not None
    plan = LivePlan(step, board=board.board())
    return GuidedCalibration(CalibrationFolder(experiment.folder), plan, open_stage(experiment, plan.board))


def in_use(experiment: Experiment) -> bytes:
    return experiment.bundle_path.read_bytes()


def test_a_half_finished_guide_leaves_what_is_used_as_it_was_and_can_be_discarded(experiment):
    calibrate_simulated(experiment)
    before, folder = in_use(experiment), CalibrationFolder(experiment.folder)
    guided = guide_of(experiment)
    for views in (1, 2, 3, 4):
        assert guided.take() == ()
        assert not guided.finish()
        # Fewer than three views make no model; from three on there is one, and it is not in use either.
        assert in_use(experiment) == before
        assert folder.record("camera") is None
        assert measured_model(folder) is None
        assert len(folder.collected("camera").boards) == views

    with pytest.raises(BadInputError, match="'camera' is started and not complete"):
        guide_of(experiment, StepName.wall)
    calibrate_simulated(experiment)
    assert is_calibrated(parts_of(experiment))

    folder.discard(StepName.camera, "camera")
    assert folder.started("camera") is None
    again = guide_of(experiment)
    again.resume()
    assert again.record is None
    assert again.wanted() == guide_of(experiment).wanted()


def test_a_complete_step_is_put_to_use_and_retaking_a_view_leaves_it_until_the_next_is_taken(experiment):
    calibrate_simulated(experiment)
    folder, guided = CalibrationFolder(experiment.folder), guide_of(experiment)
    while (task := guided.wanted()) is not None:
        guided.take()
        if guided.wanted() == task:
            guided.skip()
    assert guided.finish()
    assert folder.started("camera") is None
    assert folder.bundle().camera().quality.source == "measured"
    count = len(folder.record("camera").boards)
    assert len(CAMERA_PLAN) // 2 <= count

    before = in_use(experiment)
    guided.retake("view_03.png")
    assert not guided.finish()
    assert in_use(experiment) == before
    assert len(folder.record("camera").boards) == count
    folder.discard(StepName.camera, "camera")
    assert len(folder.collected("camera").boards) == count

    guided.retake("view_03.png")
    guided.skip()
    assert guided.finish()
    assert len(folder.record("camera").boards) == count - 1
    assert in_use(experiment) != before

    assert measured_model(folder) is not None
    calibrate_simulated(experiment)
    # A given calibration has no record behind it.
    assert measured_model(folder) is None
