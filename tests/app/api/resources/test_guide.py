"""The guided calibration through the client: asked, taken, forgotten, skipped, stopped."""

from dataclasses import replace

import pytest

from app.client import Client, ServiceError
from app.experiment.folder import open_experiment, save_settings
from core.scene import FixedTexture
from core.view_frame import turn_to
from tests.app.api.conftest import Live, finished


@pytest.fixture(scope="module")
def experiment(airlens: Client) -> str:
    return airlens.create_experiment("A rig to calibrate", camera_px=256, light="projector").experiment


def test_the_guide_asks_for_a_view_and_counts_it(airlens: Client, experiment: str):
    first = airlens.guide(experiment)
    assert first.wanted is not None
    assert first.wanted.text.startswith("Show the board in the middle")
    assert (first.state, first.views, first.covered, first.complete) == ("idle", [], 0.0, False)

    assert airlens.take_guided(experiment).state == "running"
    after = finished(lambda: airlens.guide(experiment))

    assert after.state == "idle"
    assert [view.name for view in after.views] == ["view_00.png"]
    assert after.views[0].points == 54
    assert after.covered > 0.05
    assert after.started
    assert after.wanted is not None
    assert after.wanted.nearer == "left"
    # The live picture showed it.
    assert airlens.camera().name == "simulated camera"


def test_views_are_forgotten_and_wants_are_skipped(airlens: Client, experiment: str):
    left = airlens.retake_view(experiment, "view_00.png")
    assert left.views == []
    assert not left.started
    assert left.wanted is not None
    assert left.wanted.nearer == ""
    with pytest.raises(ServiceError, match="known are: none"):
        airlens.retake_view(experiment, "view_00.png")
    skipped = airlens.skip_guided(experiment)
    assert skipped.wanted is not None
    assert skipped.wanted.nearer == "left"


def test_a_sequence_is_stopped_within_a_frame_and_blocks_a_second(airlens: Client, experiment: str):
    airlens.take_guided(experiment, "projector", frames=20)
    with pytest.raises(ServiceError, match=r"A calibration is running.*stop it"):
        airlens.take_guided(experiment, "projector")
    stopped = airlens.stop_guided(experiment, "projector")
    assert stopped.state == "idle"
    assert "kept" in stopped.reason
    assert stopped.views == []


def test_a_step_that_cannot_begin_says_why(airlens: Client, experiment: str):
    answer = airlens.guide(experiment, "wall")
    assert answer.wanted is None
    assert "calibrate" in answer.reason
    with pytest.raises(ServiceError, match="calibrate"):
        airlens.take_guided(experiment, "wall")


def test_a_started_step_is_discarded(airlens: Client, experiment: str):
    airlens.take_guided(experiment)
    assert finished(lambda: airlens.guide(experiment)).started
    discarded = airlens.discard_guided(experiment)
    assert (discarded.started, discarded.views) == (False, [])
    airlens.take_guided(experiment)
    assert len(finished(lambda: airlens.guide(experiment)).views) == 1


def test_each_camera_is_guided_by_its_name(airlens: Client, live: Live):
    made = airlens.create_experiment("Two cameras", camera_px=256).experiment
    found = open_experiment(live.app.state.services.folders.folder(made))
    (first,) = found.settings.scene.views
    turn = turn_to("x_max").back()
    second = replace(first, name="side", wall="x_max", camera=turn.optics(first.camera), light=FixedTexture())
    scene = replace(found.settings.scene, views=(first, second))
    save_settings(found.folder, found.settings.model_copy(update={"scene": scene}))
    with pytest.raises(ServiceError, match="2 views: 'camera', 'side'"):
        airlens.guide(made)
    with pytest.raises(ServiceError, match="no view 'left'; its views are 'camera', 'side'"):
        airlens.take_guided(made, view="left")

    assert airlens.take_guided(made, view="side").view == "side"
    after = finished(lambda: airlens.guide(made, view="side"))
    assert [view.name for view in after.views] == ["view_00.png"]
    assert airlens.camera(view=1).name == "simulated side"
    other = airlens.guide(made, view="camera")
    assert (other.view, other.state, other.views) == ("camera", "idle", [])
    missing = [one.name for one in airlens.calibration(made).items if one.state == "missing"]
    assert {"camera of camera", "camera of side", "wall of side", "response of side"} <= set(missing)
    assert airlens.retake_view(made, "view_00.png", camera="side").views == []
