"""Several projectors over the service: each has its own line and state, and they take turns before one camera."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.api.models.projector import ProjectorResource
from app.client import Client, ServiceError
from app.experiment.captures import load_capture
from app.experiment.folder import open_experiment, save_settings
from app.experiment.rig_settings import BoardSettings, ProjectorSettings, V4l2CameraSettings
from core.scene import ProjectedPattern
from drivers.projector.protocol import PowerState
from drivers.simulated import SimulatedCamera
from tests.app.api.conftest import Live, finished

SECOND = "light 2"
TWIN = "simulated:pjlink?warm_up_s=0&cool_down_s=0"
BOARD = BoardSettings(columns=5, rows=4, square_m=0.1)


@pytest.fixture
def client(live: Live) -> Iterator[Client]:
    with Client(live.url, live.token) as made:
        yield made
    live.app.state.services.projectors.close()
    live.app.state.services.cameras.close()


@pytest.fixture
def folder(live: Live, client: Client) -> Path:
    """A camera of the kernel that two projectors light in turn; the rig names both."""
    made = client.create_experiment(camera_px=128, light="projector").experiment
    found = open_experiment(live.app.state.services.folders.folder(made))
    scene, (first,) = found.settings.scene, found.settings.scene.views
    assert isinstance(scene.light, ProjectedPattern)
    aside_m = np.add(scene.light.projector.position_m, (0.5, 0.0, 0.0))
    light = replace(scene.light, projector=replace(scene.light.projector, position_m=tuple(aside_m.tolist())))
    second = replace(first, name=SECOND, light=light, camera_of=first.name)
    named = {
        "camera": V4l2CameraSettings(kind="v4l2", width_px=128, height_px=96, exposure_s=0.02),
        "projector": ProjectorSettings(url=TWIN),
        "projectors": {SECOND: ProjectorSettings(url=TWIN)},
        "board": BOARD,
    }
    rig, scene = found.settings.rig.model_copy(update=named), replace(scene, views=(first, second))
    save_settings(found.folder, found.settings.model_copy(update={"rig": rig, "scene": scene}))
    client.confirm_addresses(made, ["/dev/video0"])
    return found.folder


@pytest.fixture
def wall(live: Live, client: Client, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both projectors connected and lit; what the camera sees is what is not muted."""
    services = live.app.state.services
    for view in (0, 1):
        client.connect_projector(folder.name, view)
        client.change_projector(power="on", view=view)

    def seen() -> np.ndarray:
        twins = [services.projectors.held(folder.name, view) for view in (0, 1)]
        lit = [0.2 * (n + 1) * (not twin.status().muted) for n, twin in enumerate(twins)]
        return np.full((96, 128), sum(lit), np.float32)

    def opened(experiment, air, view=0, moment=None) -> SimulatedCamera:
        return SimulatedCamera(seen, seed=1, name="of the kernel")

    monkeypatch.setattr(services.desk, "_opener", opened)
    return folder.name


def muted(client: Client) -> list[bool | None]:
    return [client.change_projector(view=view).muted for view in (0, 1)]


def levels(folder: Path) -> list[float]:
    capture = load_capture(open_experiment(folder).latest_capture("reference"))
    return [float(image.mean.mean()) for image in capture.images]


def test_each_is_seen_switched_and_freed_by_itself(client: Client, folder: Path):
    assert [one.spoken_to for one in client.experiment(folder.name).views] == [True, True]
    with pytest.raises(ServiceError, match=r"No projector is connected for view 5\. Connect it first"):
        client.projector(5)
    assert client.connect_projector(folder.name, 1).view == 1
    assert client.projector().state == "closed"
    client.connect_projector(folder.name)
    assert client.change_projector(power="on", view=1).state == PowerState.ON
    found = [one for one in client.devices() if isinstance(one, ProjectorResource)]
    assert [(one.view, one.state, one.experiment) for one in found] == [
        (0, "standby", folder.name),
        (1, "on", folder.name),
    ]
    assert client.change_projector(muted=True, view=1).muted
    sent = [[line.text for line in client.wire(view=view) if line.direction == ">"] for view in (0, 1)]
    assert [any("AVMT 11" in text for text in texts) for texts in sent] == [False, True]
    assert client.disconnect_projector(1).state == "closed"
    assert client.projector(0).state == "standby"
    told = [one.body for one in client.past_events(limit=500) if one.body.get("device") == "projector"]
    assert [one["view"] for one in told if one["state"] == "on"] == [1]


def test_a_view_without_an_address_or_that_is_not_there_is_named(client: Client, folder: Path):
    found = open_experiment(folder)
    rig = found.settings.rig.model_copy(update={"projectors": None})
    save_settings(folder, found.settings.model_copy(update={"rig": rig}))
    assert [one.spoken_to for one in client.experiment(folder.name).views] == [True, False]
    with pytest.raises(ServiceError, match=rf'no projector for {SECOND!r}.*\[rig.projectors."{SECOND}"\]'):
        client.connect_projector(folder.name, 1)
    with pytest.raises(ServiceError, match="has 2 views; there is no view 2"):
        client.connect_projector(folder.name, 2)


def test_another_experiments_lines_are_freed_for_they_may_be_the_same(client: Client, folder: Path):
    client.connect_projector(folder.name, 1)
    other = client.create_experiment(camera_px=64, light="projector").experiment
    assert client.connect_projector(other).experiment == other
    assert client.projector(1).state == "closed"


def test_they_take_turns_in_a_capture_and_in_one_that_is_taken_again(
    client: Client, live: Live, folder: Path, wall: str
):
    desk = live.app.state.services.desk
    client.start_capture(wall, "reference", frames=2)
    assert desk.wait(60).reason == ""
    np.testing.assert_allclose(levels(folder), [0.2, 0.4], atol=0.03)
    assert muted(client) == [True, False]
    (taken,) = client.captures(wall)
    client.retake_capture(wall, taken.capture, taken.views[0].view)
    assert desk.wait(60).reason == ""
    assert muted(client) == [False, True]
    np.testing.assert_allclose(levels(folder), [0.2, 0.4], atol=0.03)


def test_all_are_dark_but_the_one_that_is_calibrated_by(client: Client, live: Live, wall: str):
    client.start_capture(wall, "dark", frames=1)  # opens the camera
    live.app.state.services.desk.wait(60)
    client.change_projector(muted=True, view=0)
    client.take_guided(wall, "camera", view="camera", settle_s=0)
    now = finished(lambda: client.guide(wall, "camera", "camera"))
    assert now.state == "idle", now.reason
    assert muted(client) == [False, True]


def test_the_identify_frame_says_whose_projector_it_is_on(client: Client, folder: Path):
    shown = [
        cv2.imdecode(np.frombuffer(client.preview_pattern(folder.name, "identify", 4096, view), np.uint8), 0)
        for view in (0, 1)
    ]
    assert shown[0] is not None
    assert shown[1] is not None
    rows = np.flatnonzero((shown[0] != shown[1]).any(axis=1))
    # Below the size, which is in the middle, and above the lower markers.
    assert shown[0].shape[0] / 2 < rows.min()
    assert rows.max() < 0.75 * shown[0].shape[0]
