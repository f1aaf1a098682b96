"""Captures of two cameras through the service: one of them fails, and is taken again alone."""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.client import Client, ServiceError
from app.errors import BadInputError
from app.experiment.folder import open_experiment, save_settings
from app.rig.open import open_camera
from tests.app.api.conftest import Live


@pytest.fixture(scope="module")
def client(live: Live) -> Iterator[Client]:
    with Client(live.url, live.token) as open_client:
        yield open_client


@pytest.fixture(scope="module")
def experiment(live: Live, client: Client) -> str:
    made = client.create_experiment(camera_px=64).experiment
    found = open_experiment(live.app.state.services.folders.folder(made))
    (first,) = found.settings.scene.views
    scene = replace(found.settings.scene, views=(first, replace(first, name="second")))
    save_settings(found.folder, found.settings.model_copy(update={"scene": scene}))
    return made


def finish(client: Client) -> tuple[str, str]:
    until_s = time.monotonic() + 200
    while (now := client.running_capture()).state == "running":
        assert time.monotonic() < until_s
        time.sleep(0.02)
    return now.state, now.reason


def test_a_camera_that_failed_is_taken_alone_and_completes_the_capture(
    client: Client, experiment: str, monkeypatch: pytest.MonkeyPatch
):
    def broken(found, air, view=0, moment=None):
        if view == 1:
            raise BadInputError("The second camera does not answer.")
        return open_camera(found, air, view, moment)

    with monkeypatch.context() as patch:
        patch.setattr("app.capture.views.open_camera", broken)
        client.start_capture(experiment, "reference", frames=3)
        state, reason = finish(client)
    assert state == "incomplete"
    assert "lacks the pictures of 'second'" in reason
    (waiting,) = client.captures(experiment)
    assert (waiting.state, waiting.missing, waiting.retakes) == ("interrupted", ["second"], True)
    with pytest.raises(ServiceError, match="no view 'third'; its views are 'camera', 'second'"):
        client.retake_capture(experiment, waiting.capture, "third")

    begun = client.retake_capture(experiment, waiting.capture)
    assert (begun.capture, begun.role, begun.total) == (waiting.capture, "reference", 3)
    assert finish(client) == ("finished", "")
    (whole,) = client.captures(experiment)
    assert (whole.capture, whole.state, whole.missing) == (waiting.capture, "finished", [])
    assert [(one.view, one.frames) for one in whole.views] == [("camera", 3), ("second", 3)]


def test_a_camera_of_a_whole_capture_is_taken_again_and_the_other_picture_stays(
    client: Client, experiment: str
):
    first = client.captures(experiment)[0]
    begun = client.retake_capture(experiment, first.capture, "second", minutes_on=40)
    assert begun.capture != first.capture
    assert finish(client) == ("finished", "")
    newest = client.captures(experiment)[0]
    assert newest.capture == begun.capture
    # What the first camera saw is the very picture of the capture before.
    before, after = (client.capture_image(experiment, one.capture) for one in (first, newest))
    np.testing.assert_array_equal(before, after)
    assert client.running_capture().burst == 1


def test_what_cannot_be_taken_alone_says_why(client: Client, experiment: str):
    with pytest.raises(ServiceError, match="no capture 'none'"):
        client.retake_capture(experiment, "none", "second")
    client.start_capture(experiment, "flow", frames=2, bursts=2, every_s=0.5)
    assert finish(client)[0] == "finished"
    burst = client.captures(experiment)[0]
    assert not burst.retakes
    with pytest.raises(ServiceError, match="belong together"):
        client.retake_capture(experiment, burst.capture, "second")
    assert client.running_capture().state == "finished"
