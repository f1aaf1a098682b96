"""The projector over the service: power with its warm-up, the guarded lamp, the wire, and the kiosk's pattern."""

import hashlib
import time

import cv2
import httpx
import numpy as np
import pytest

from app.client import Client, ServiceError
from app.rig.patterns import pattern_picture
from drivers.projector.escvp21 import EscVp21
from drivers.projector.link import ProjectorLink
from drivers.simulated import VirtualClock
from drivers.simulated.projector.engine import ProjectorFault, SimulatedProjector
from drivers.simulated.projector.escvp21 import EscVp21Twin
from drivers.simulated.projector.hosts import LoopPort
from drivers.simulated.projector.state import TwinState
from tests.app.api.conftest import Live


@pytest.fixture
def client(live: Live):
    with Client(live.url, live.token) as made:
        yield made
    live.app.state.services.projector.close()


@pytest.fixture
def experiment(client: Client) -> str:
    return client.create_experiment(camera_px=64, light="projector").experiment


def until(client: Client, state: str, limit_s: float = 100.0) -> None:
    deadline_s = time.monotonic() + limit_s
    while client.projector().state != state:
        assert time.monotonic() < deadline_s, client.projector()
        time.sleep(0.1)


def test_a_lamp_warms_up_shows_and_is_not_put_out_too_soon(client: Client, experiment: str):
    assert client.connect_projector(experiment).state == "standby"
    assert client.change_projector(power="on").state == "warming"
    with pytest.raises(ServiceError, match="still warming up"):
        client.change_projector(muted=True)
    until(client, "on")
    seen = client.change_projector(muted=True)
    assert (seen.muted, seen.frozen, seen.source, seen.lamp_hours) == (True, False, "30", 1234)
    assert seen.lamp_on_s is not None
    assert seen.lamp_on_s > 5
    with pytest.raises(ServiceError, match="The lamp was lit only just now") as refused:
        client.change_projector(power="off")
    assert refused.value.problem.code == "conflict"
    sent = [line.text for line in client.wire() if line.direction == ">"]
    assert "PWR ON\\r" in sent
    assert "MUTE ON\\r" in sent
    assert client.disconnect_projector().state == "closed"


def test_a_projector_that_falls_silent_is_asked_on_until_it_speaks(client: Client, live: Live):
    clock = VirtualClock()
    silent = [True]
    twin = SimulatedProjector(
        EscVp21Twin(TwinState(clock)), lambda _: ProjectorFault.SILENCE if silent[0] else None
    )
    services = live.app.state.services
    services.projector.open("room", lambda: ProjectorLink(EscVp21(), LoopPort(twin), clock=clock))
    told = client.projector()
    assert told.state == "silent"
    assert "Check its power and its cable" in told.reason
    silent[0] = False
    until(client, "standby")


def test_a_rig_without_a_projector_says_what_to_write(client: Client):
    texture = client.create_experiment(camera_px=64).experiment
    with pytest.raises(ServiceError, match=r"\[rig.projector\] with url"):
        client.connect_projector(texture)
    with pytest.raises(ServiceError, match="printed texture"):
        client.show_pattern(texture)


def test_a_pattern_is_shown_once_the_kiosk_page_read_back_the_same_pixels(
    client: Client, live: Live, experiment: str
):
    assert client.show_pattern(experiment, "identify").state in ("waiting", "away")
    services = live.app.state.services
    picture = pattern_picture(services.folders.open(experiment), "identify")
    with httpx.Client(base_url=f"{live.url}/kiosk", headers=live.bearer) as kiosk:
        wanted = kiosk.get("/frame").json()
        drawn = kiosk.get(f"/frames/{wanted['id']}").content
        assert drawn == picture.tobytes()
        rows, cols = picture.shape
        word = {"id": wanted["id"], "reason": "", "width_px": cols, "height_px": rows}
        word |= {"digest": hashlib.sha256(drawn).hexdigest(), "device_pixel_ratio": 1.0}
        assert kiosk.post("/report", json=word).status_code == 204
    assert client.screen().state == "showing"
    preview = cv2.imdecode(np.frombuffer(client.preview_pattern(experiment, "white"), np.uint8), 0)
    assert preview is not None
    assert preview.min() == 255
    assert client.clear_screen().state == "empty"
