"""A board before two cameras at once, through the client: asked, taken, found on each, forgotten, adjusted."""

from pathlib import Path

import numpy as np
import pytest

from app.calibrate.folder import CalibrationFolder
from app.calibrate.together_live import TogetherPlan, TogetherSession
from app.client import Client, ServiceError
from app.errors import AirlensError
from app.experiment.folder import open_experiment, save_settings
from app.rig.open import open_stage
from app.rig.stage import RealStage
from drivers.simulated import SimulatedCamera
from drivers.simulated.faults import CameraFault
from tests.app.api.conftest import Live, finished
from tests.app.calibrate.test_together import experiment, smaller
from tests.calibration.test_together import rig


@pytest.fixture(scope="module")
def made(live: Live) -> str:
    folder = live.app.state.services.folders.root / "two"
    return experiment(folder, smaller(rig(11))).name


def test_places_are_taken_by_both_cameras_and_what_each_found_is_told(airlens: Client, made: str):
    first = airlens.places_together(made, 3)
    assert first.wanted is not None
    assert first.wanted.startswith("Place 1 of 3: hold the board where two cameras or more (a, b)")
    assert [(one.view, one.camera, one.points_px) for one in first.cameras] == [("a", 0, []), ("b", 1, [])]
    assert (first.state, first.places, first.pairs, first.enough) == ("idle", [], [], False)

    assert airlens.take_place(made, places=3).state == "running"
    after = finished(lambda: airlens.places_together(made, 3))
    assert (after.state, after.reason) == ("idle", "")
    (place,) = after.places
    assert {one.view: one.points for one in place.seen} == {"a": 30, "b": 30}
    for one in after.cameras:
        assert len(one.points_px) == 30
        assert all(0 < u < one.width_px and 0 < v < one.height_px for u, v in one.points_px)
    # Both are looked at side by side, and the guide of one camera tells that it is not the one that was asked.
    assert {airlens.camera(view).state for view in (0, 1)} == {"ready"}
    assert airlens.guide(made, view="a").state == "idle"


def test_a_place_is_forgotten_and_taken_again_until_there_are_enough(airlens: Client, made: str):
    (place,) = airlens.places_together(made).places
    assert airlens.retake_place(made, place.place).places == []
    with pytest.raises(ServiceError, match=f"There is no place '{place.place}'; known are: none"):
        airlens.retake_place(made, place.place)
    for _ in range(2):
        airlens.take_place(made, places=3)
        assert finished(lambda: airlens.places_together(made, 3)).issues == []
    assert airlens.skip_place(made, places=3).enough
    assert airlens.places_together(made, 4).wanted is not None


def test_the_adjustment_says_how_the_cameras_stand_and_is_told_from_then_on(airlens: Client, made: str):
    told = airlens.calibrate_together(made)
    (pair,) = told.pairs
    assert pair.views == ["a", "b"]
    assert 0 < pair.apart_std_m < 0.01
    assert [one.view for one in told.moved] == ["a", "b"]
    assert airlens.places_together(made).pairs == told.pairs
    # Forgetting the boards leaves the calibration in use.
    left = airlens.discard_places(made)
    assert (left.places, left.pairs) == ([], told.pairs)


def test_what_cannot_begin_says_why(airlens: Client, live: Live, tmp_path: Path):
    alone = airlens.create_experiment("One camera", camera_px=256).experiment
    assert "one camera; expected two or more" in airlens.places_together(alone).reason
    root = live.app.state.services.folders.root
    bare = experiment(root / "bare", smaller(rig(11)))
    settings = open_experiment(bare).settings
    save_settings(bare, settings.model_copy(update={"rig": settings.rig.model_copy(update={"board": None})}))
    assert "The board is not known" in airlens.places_together("bare").reason
    with pytest.raises(ServiceError, match="The board is not known"):
        airlens.take_place("bare")
    board = {"columns": 6, "rows": 5, "square_m": 0.15}
    for file in (bare / "calibration").iterdir():
        file.unlink()
    with pytest.raises(ServiceError, match="'a', 'b' have no camera calibrated from pictures"):
        airlens.take_place("bare", board=board)


def test_a_camera_that_fails_is_named_and_the_other_is_not_blamed(tmp_path: Path):
    folder = experiment(tmp_path / "failing", smaller(rig(11)))
    opened = open_experiment(folder)
    assert opened.settings.rig.board is not None
    board = opened.settings.rig.board.board()
    good = {name: open_stage(opened, board, view=number) for number, name in enumerate("ab")}
    dark = np.zeros((230, 307), np.float32)
    gone = SimulatedCamera(lambda: dark, seed=0, faults=lambda number: CameraFault.UNPLUG)
    plan = TogetherPlan(board, places=1)

    with pytest.raises(AirlensError, match=r"The camera of 'b'.*take it again") as told:
        TogetherSession(CalibrationFolder(folder), plan, good | {"b": RealStage(gone)}).take()
    assert "'a'" not in str(told.value)
    # The picture that was taken is there, counts for nothing, and the next session goes on behind it.
    again = TogetherSession(CalibrationFolder(folder), plan, good)
    assert again.take() == ()
    assert [place.name for place in CalibrationFolder(folder).shared().boards] == ["place_01"]
    assert sorted(again.newest) == ["a", "b"]
