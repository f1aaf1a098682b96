"""The live picture over the service: frames for credits, newest wins, guarded like everything else."""

import json
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from app.client import Client, ServiceError
from app.experiment.folder import save_settings
from app.experiment.rig_settings import V4l2CameraSettings
from drivers.simulated import SimulatedCamera
from tests.app.api.conftest import Live
from tests.app.rig.test_live_camera import SCENE


@pytest.fixture
def camera(live: Live) -> Iterator[Live]:
    live.app.state.services.camera.open("room", lambda: SimulatedCamera(lambda: SCENE, seed=1))
    yield live
    live.app.state.services.camera.close()


def viewer(live: Live) -> ClientConnection:
    return connect(
        f"ws://127.0.0.1:{live.port}/api/devices/camera/live", additional_headers=live.bearer, proxy=None
    )


def read(socket: ClientConnection) -> tuple[dict, np.ndarray]:
    message = socket.recv(timeout=60)
    assert isinstance(message, bytes)
    length = int.from_bytes(message[:4], "big")
    jpeg = np.frombuffer(message[4 + length :], np.uint8)
    return json.loads(message[4 : 4 + length]), cv2.imdecode(jpeg, cv2.IMREAD_UNCHANGED)


def test_a_viewer_gets_one_frame_a_credit_and_none_without(camera: Live):
    with viewer(camera) as socket:
        with pytest.raises(TimeoutError):
            socket.recv(timeout=0.3)
        socket.send(json.dumps({"credits": 2}))
        first, second = read(socket)[0], read(socket)[0]
        assert second["number"] > first["number"]
        with pytest.raises(TimeoutError):
            socket.recv(timeout=0.3)


def test_a_slow_viewer_skips_to_the_newest(camera: Live):
    with viewer(camera) as fast, viewer(camera) as slow:
        slow.send(json.dumps({"credits": 1}))
        before = read(slow)[0]["number"]
        for _ in range(10):
            fast.send(json.dumps({"credits": 1}))
            newest = read(fast)[0]["number"]
        slow.send(json.dumps({"credits": 1}))
        # Both hear of a frame one after the other: the slow one may be a frame behind, never more.
        assert read(slow)[0]["number"] + 1 >= newest > before + 5


def test_the_picture_shows_the_scene_with_its_numbers(camera: Live):
    with viewer(camera) as socket:
        socket.send(json.dumps({"credits": 1}))
        numbers, picture = read(socket)
    assert picture.shape == SCENE.shape == (numbers["rows"], numbers["cols"])
    # JPEG and noise: a few grey levels in 255.
    assert np.abs(picture.mean(0) / 255 - SCENE[0]).max() < 0.05
    assert numbers["mean"] == pytest.approx(float(SCENE.mean()), abs=0.02)


def test_the_websocket_is_guarded(camera: Live):
    url = f"ws://127.0.0.1:{camera.port}/api/devices/camera/live"
    for headers in ({}, {**camera.bearer, "Origin": "http://evil.example"}):
        with pytest.raises(InvalidStatus) as caught:
            connect(url, additional_headers=headers, proxy=None).close()
        assert caught.value.response.status_code in (401, 403)


def test_nonsense_from_a_viewer_closes_its_picture_only(camera: Live):
    with viewer(camera) as socket, viewer(camera) as other:
        socket.send("[1, 2")
        other.send(json.dumps({"credits": 1}))
        assert read(other)[0]["number"] > 0


def test_one_frame_and_the_settings_by_the_client(camera: Live):
    with Client(camera.url, camera.token) as airlens:
        assert airlens.camera().state == "ready"
        assert airlens.change_camera(gain=2.0).gain == 2.0
        assert airlens.frame(stretch=True).startswith(b"\xff\xd8")
        assert airlens.disconnect_camera().state == "closed"
        with pytest.raises(ServiceError) as caught:
            airlens.change_camera(gain=2.0)
        assert caught.value.problem.code == "not_found"
        with pytest.raises(ServiceError) as caught:
            airlens.connect_camera("no-such-experiment")
        assert caught.value.problem.code == "not_found"


def test_mjpeg_is_there_for_a_browser_without_websocket(camera: Live):
    with camera.client() as http, http.stream("GET", "/api/devices/camera/live.mjpeg") as answer:
        assert answer.headers["content-type"].startswith("multipart/x-mixed-replace")
        first = next(answer.iter_bytes())
    assert first.startswith(b"--frame\r\nContent-Type: image/jpeg")


def test_a_view_that_another_ones_camera_takes_shows_that_camera(live: Live, monkeypatch: pytest.MonkeyPatch):
    opened: list[int] = []

    def camera_of(experiment, air, view=0, moment=None):
        opened.append(view)
        return SimulatedCamera(lambda: SCENE, seed=1)

    monkeypatch.setattr("app.api.resources.devices.open_camera", camera_of)
    with Client(live.url, live.token) as client:
        made = client.create_experiment("Two lights", camera_px=128, light="projector").experiment
        found = live.app.state.services.folders.open(made)
        scene = found.settings.scene
        second = replace(scene.views[0], name="second", light=scene.light, camera_of=scene.views[0].name)
        kernel = V4l2CameraSettings(kind="v4l2", width_px=128, height_px=96)
        rig = found.settings.rig.model_copy(update={"camera": kernel})
        changed = {"rig": rig, "scene": replace(scene, views=(scene.views[0], second))}
        save_settings(found.folder, found.settings.model_copy(update=changed))
    with live.client() as asking:
        asking.put(f"/api/experiments/{made}/addresses", json={"addresses": ["/dev/video0"]})
        views = asking.get(f"/api/experiments/{made}").json()["views"]
        assert [(one["camera"], one["camera_of"], one["light"]) for one in views] == [
            (0, None, "projector"),
            (0, views[0]["name"], "projector"),
        ]
        answer = asking.post("/api/devices/camera/connect", json={"experiment": made, "view": 1}).json()
        assert (answer["view"], answer["state"]) == (0, "ready")
        assert opened == [0]
        assert len(live.app.state.services.cameras.known) == 1
        asking.post("/api/devices/camera/disconnect")
