"""From nothing to two captures through the client, with the simulated rig and its faults."""

import time

import cv2
import numpy as np
import pytest

from app.client import Client, ServiceError
from app.rig.open import open_camera
from drivers.simulated import CameraFault, SimulatedCamera
from tests.app.api.conftest import Live, finished


@pytest.fixture(scope="module")
def experiment(airlens: Client) -> str:
    made = airlens.create_experiment("A room to practise", camera_px=96)
    airlens.connect_camera(made.experiment)
    return made.experiment


def test_an_experiment_that_is_still_being_made_is_not_listed(airlens: Client, experiment: str, live: Live):
    unfinished = live.config.data_root / "experiments" / ".20260101T000000-simulated.unfinished"
    unfinished.mkdir()
    (unfinished / "experiment.toml").write_text("half of it")
    assert [one.experiment for one in airlens.experiments()] == [experiment]


def test_a_new_experiment_is_listed_connected_and_not_calibrated(airlens: Client, experiment: str):
    line = next(one for one in airlens.experiments() if one.experiment == experiment)
    assert (line.title, line.camera, line.calibrated, line.captures) == (
        "A room to practise",
        "simulated",
        False,
        0,
    )
    assert airlens.camera().state == "ready"
    assert airlens.experiment(experiment).settings["scene"]["room"]["upper_m"][1] > 0
    nothing = airlens.calibration(experiment)
    assert (nothing.state, nothing.date, nothing.rig) == ("incomplete", None, [])
    assert {item.state for item in nothing.items} == {"missing"}
    assert airlens.experiment(experiment).uncalibrated == ["camera", "wall"]


def test_the_board_is_kept_and_an_impossible_one_refused(airlens: Client, experiment: str):
    board = {"kind": "charuco", "columns": 8, "rows": 5, "square_m": 0.05, "marker_m": 0.03}
    kept = airlens.change_experiment(experiment, board=board).settings["rig"]["board"]
    assert {name: kept[name] for name in board} == board
    with pytest.raises(ServiceError, match="markers smaller than squares"):
        airlens.change_experiment(experiment, board=board | {"marker_m": 0.2})
    assert airlens.experiment(experiment).settings["rig"]["board"] == kept


def test_a_simulated_rig_is_calibrated_in_one_step(airlens: Client, experiment: str):
    made = airlens.calibrate(experiment)
    assert [item.name for item in made.items][-1].startswith("response")
    assert airlens.calibration(experiment) == made
    assert {item.state for item in made.items} == {"given"}
    assert airlens.experiment(experiment).calibrated


def test_a_reference_and_a_flow_are_taken_and_differ_by_the_air(airlens: Client, experiment: str):
    for role in ("reference", "flow"):
        assert airlens.start_capture(experiment, role, frames=4).state == "running"
        assert finished(airlens.running_capture).state == "finished"
    flow, reference = airlens.captures(experiment)
    assert (reference.role, reference.frames, reference.state) == ("reference", 4, "finished")
    images = [airlens.capture_image(experiment, one.capture) for one in (reference, flow)]
    assert images[0].shape == (72, 96)
    assert 0 < float(np.abs(images[0] - images[1]).mean()) < 0.1
    picture = cv2.imdecode(
        np.frombuffer(airlens.capture_picture(experiment, flow.capture, width=48), np.uint8),
        cv2.IMREAD_UNCHANGED,
    )
    assert picture.shape == (36, 48)


def test_the_shift_since_the_reference_is_small_while_the_air_is_still(airlens: Client, experiment: str):
    airlens.connect_camera(experiment, air="still")
    seen = airlens.shift()
    assert seen.reference.endswith("reference")
    # One noisy frame of 96 x 72 px: a tenth of a pixel.
    assert np.hypot(*seen.drift_px) < 0.1
    assert 0 <= seen.age_s < 600


def test_notes_stay_beside_a_capture(airlens: Client, experiment: str):
    name = airlens.captures(experiment)[0].capture
    assert airlens.annotate_capture(experiment, name, "fan on, door open").notes == "fan on, door open"
    assert airlens.capture(experiment, name).notes == "fan on, door open"


@pytest.mark.parametrize("discard", [True, False])
def test_an_abort_acts_at_once_and_keeps_or_discards(airlens: Client, experiment: str, discard: bool):
    before = len(airlens.captures(experiment))
    airlens.start_capture(experiment, "flow", frames=50_000)
    with pytest.raises(ServiceError) as caught:
        airlens.start_capture(experiment, "flow", frames=2)
    assert caught.value.problem.code == "conflict"
    while airlens.running_capture().done < 2:
        time.sleep(0.02)
    assert airlens.abort_capture(discard).state == "aborted"
    after = airlens.captures(experiment)
    assert len(after) == before + (0 if discard else 1)
    if not discard:
        kept = next(one for one in after if one.state == "incomplete")
        airlens.discard_capture(experiment, kept.capture)
        assert len(airlens.captures(experiment)) == before


def test_a_camera_unplugged_during_a_burst_is_told_and_the_next_burst_works(
    live: Live, airlens: Client, experiment: str
):
    services = live.app.state.services
    still = open_camera(services.folders.open(experiment), "still").expected(0)
    view = (still / np.float32(4095)).astype(np.float32)

    def faulty() -> SimulatedCamera:
        return SimulatedCamera(lambda: view, seed=1, faults=lambda n: CameraFault.UNPLUG if n == 30 else None)

    services.camera.open(experiment, faulty, "still")
    airlens.start_capture(experiment, "reference", frames=60)
    assert finished(airlens.running_capture).state in ("incomplete", "failed")
    told = airlens.running_capture().reason
    assert "device lost" in told
    assert "again" in told
    listed = airlens.captures(experiment)
    assert [one.state for one in listed].count("interrupted") == 1
    airlens.connect_camera(experiment)
    airlens.start_capture(experiment, "reference", frames=2)
    assert finished(airlens.running_capture).state == "finished"
    for one in listed:
        if one.state == "interrupted":
            airlens.discard_capture(experiment, one.capture)
    assert "interrupted" not in [one.state for one in airlens.captures(experiment)]


def test_title_and_notes_of_an_experiment_change_and_the_scene_stays(airlens: Client, experiment: str):
    before = airlens.experiment(experiment).settings["scene"]
    after = airlens.change_experiment(experiment, title="Second floor")
    assert (after.title, after.settings["scene"]) == ("Second floor", before)
