"""The kiosk's routes and its waiting, with a page played by the test."""

import threading

import httpx
import numpy as np
import pytest

from app.kiosk.screen import KioskScreen
from app.kiosk.screens import KioskScreens, page_of
from app.kiosk.server import serve_kiosk
from drivers.display import PatternDisplay, picture_digest
from drivers.errors import DeviceSettingError, DeviceTimeoutError

PICTURE = np.arange(12, dtype=np.uint8).reshape(3, 4)


def page(client, digest=None, reason="", at="/kiosk"):
    """Do what the page does: look, fetch, report."""
    frame = client.get(f"{at}/frame").json()
    data = client.get(f"{at}/frames/{frame['id']}").content
    drawn = np.frombuffer(data, np.uint8).reshape(frame["height_px"], frame["width_px"])
    body = {
        "id": frame["id"],
        "digest": picture_digest(drawn) if digest is None else digest,
        "reason": reason,
    }
    body |= {"width_px": 4, "height_px": 3, "device_pixel_ratio": 1.0}
    return client.post(f"{at}/report", json=body)


def shown(screen, client, **answer):
    """Run `show` in a thread and answer as the page; return its result or error."""
    outcome = []

    def run():
        try:
            outcome.append(screen.show(PICTURE))
        except Exception as error:
            outcome.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    while client.get("/kiosk/frame").json()["id"] == "":
        pass
    page(client, **answer)
    thread.join()
    return outcome[0]


@pytest.fixture
def kiosk():
    screens = KioskScreens(timeout_s=100.0)
    screen = screens.of(0)
    with serve_kiosk(screens) as url, httpx.Client(base_url=url) as client:
        yield screen, client


def test_a_drawn_picture_is_acknowledged_by_its_digest(kiosk):
    screen, client = kiosk
    assert isinstance(screen, PatternDisplay)
    assert shown(screen, client) == picture_digest(PICTURE)
    assert screen.is_showing(picture_digest(PICTURE))
    screen.close()
    assert not screen.is_showing(picture_digest(PICTURE))


def test_a_refusal_and_wrong_pixels_are_told(kiosk):
    screen, client = kiosk
    refused = shown(screen, client, digest="", reason="This window has 5 x 5 screen pixels")
    assert isinstance(refused, DeviceSettingError)
    assert "5 x 5" in str(refused)
    screen.close()
    wrong = shown(screen, client, digest="0" * 64)
    assert isinstance(wrong, DeviceSettingError)
    assert "other pixels" in str(wrong)


def test_no_page_is_a_timeout_that_says_what_to_open():
    with pytest.raises(DeviceTimeoutError, match="airlens kiosk"):
        KioskScreen(timeout_s=0.05).show(PICTURE)


def test_the_page_brings_no_script_but_its_own_and_strangers_are_refused(kiosk):
    _, client = kiosk
    answer = client.get("/kiosk/page")
    assert "script-src 'self'" in answer.headers["content-security-policy"]
    assert "<script src=" in answer.text
    assert client.get("/kiosk/page", headers={"host": "evil.example"}).status_code == 400
    assert client.get("/kiosk/frames/none").status_code == 404
    assert client.post("/kiosk/report", json={"id": "x"}).status_code == 422


def test_each_projector_has_a_page_of_its_own():
    screens = KioskScreens(timeout_s=100.0)
    other = 255 - PICTURE
    with serve_kiosk(screens) as url, httpx.Client(base_url=url) as client:
        screens.of(0).put(PICTURE)
        digest = screens.of(3).put(other)
        assert page_of(0) == "/kiosk/page"
        assert client.get(page_of(3)).text == client.get(page_of(0)).text
        assert client.get("/kiosk/3/kiosk.js").status_code == 200
        assert page(client, at="/kiosk/3").status_code == 204
        assert screens.of(3).is_showing(digest)
        assert not screens.of(0).is_showing(picture_digest(PICTURE))
        assert page(client).status_code == 204
        assert screens.of(0).is_showing(picture_digest(PICTURE))
        assert client.get("/kiosk/100/frame").status_code == 422
