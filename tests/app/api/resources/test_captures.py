"""Captures of two cameras through the service: one of them fails, and is taken again alone."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from app.api.models.devices import CameraResource
from app.client import Client, ServiceError
from app.errors import BadInputError
from app.experiment.captures import load_capture
from app.experiment.folder import open_experiment, save_settings
from app.rig.open import open_camera
from tests.app.api.conftest import Live, finished


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
    now = finished(client.running_capture)
    return now.state, now.reason


def test_a_camera_that_failed_is_taken_alone_and_completes_the_capture(
    live: Live, client: Client, experiment: str, monkeypatch: pytest.MonkeyPatch
):
    def broken(found, air, view=0, moment=None):
        if view == 1:
            raise BadInputError("The second camera does not answer.")
        return open_camera(found, air, view, moment)

    with monkeypatch.context() as patch:
        patch.setattr(live.app.state.services.desk, "_opener", broken)
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


def test_every_view_has_its_live_camera_and_all_are_taken_at_once(
    live: Live, client: Client, experiment: str
):
    with pytest.raises(ServiceError, match="no view 2"):
        client.connect_camera(experiment, view=2)
    with pytest.raises(ServiceError, match="No camera is open for view 7"):
        client.camera(view=7)
    assert [client.connect_camera(experiment, view=view).view for view in (0, 1)] == [0, 1]
    cameras = [one for one in client.devices() if one.device == "camera"]
    assert [(one.view, one.state, one.name) for one in cameras if isinstance(one, CameraResource)] == [
        (0, "ready", "simulated camera"),
        (1, "ready", "simulated second"),
    ]
    assert client.change_camera(exposure_s=0.01, view=1).exposure_s == pytest.approx(0.01)
    assert client.camera().exposure_s == pytest.approx(0.02)
    assert client.frame(view=1) != client.frame()
    client.start_capture(experiment, "reference", frames=4, at_once=True)
    assert finish(client) == ("finished", "")
    newest = client.captures(experiment)[0]
    assert [(one.view, one.frames) for one in newest.views] == [("camera", 4), ("second", 4)]
    folder = live.app.state.services.folders.item(experiment, "capture", newest.capture)
    told = load_capture(folder).manifest["origin"]["cameras"]
    assert told["at_once"] is True
    assert told["apart_s"] >= 0
    assert client.shift(view=1).reference == newest.capture
    # Another experiment may name the same devices: its cameras take their place.
    other = client.create_experiment(camera_px=64).experiment
    client.connect_camera(other)
    assert client.camera(view=1).state == "closed"
    client.disconnect_camera()
    assert client.camera().state == "closed"
