"""The guided calibration on Calibrate: asked, taken, judged, forgotten, taken again, on to the next step."""

import re

import pytest
from playwright.sync_api import Page, expect

from app.client import Client
from tests.browser.conftest import Opens, Station, snapshot
from tests.browser.test_faults import go_to

# Twelve views are rendered, searched and fitted again and again: half a minute where nobody else computes.
VIEWS_MS = 800_000


def choose_step(page: Page, step: str) -> None:
    page.get_by_role("button", name=re.compile(rf"\d\. {step}")).click()


@pytest.mark.timeout(1500)
def test_a_calibration_is_guided_from_the_first_view_to_the_response(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        client.connect_camera(client.create_experiment(camera_px=256).experiment)
    watched = opens(station.address)
    page = watched.page
    go_to(page, "Calibrate")
    views = page.locator("table.taken tbody tr")
    expect(page.locator(".wanted")).to_contain_text("Show the board in the middle")
    page.get_by_role("button", name="Take", exact=True).click()
    expect(views).to_have_count(1)
    page.get_by_label("Go on by itself").check()
    expect(views).to_have_count(12, timeout=VIEWS_MS)
    expect(page.locator(".wanted")).to_contain_text("Everything that this step asks for is taken")
    snapshot(page, "guide-camera")
    known = page.locator("section[aria-labelledby=known-title]")
    expect(known).to_contain_text("Still to calibrate: wall.")
    expect(known.get_by_role("row", name="back wall")).to_contain_text("missing")
    page.get_by_role("row", name="view_03.png").get_by_role("button", name="Retake").click()
    expect(views).to_have_count(11)
    page.get_by_role("button", name="Take", exact=True).click()
    expect(views).to_have_count(12)
    choose_step(page, "wall")
    page.get_by_role("button", name="Take", exact=True).click()
    expect(page.get_by_role("row", name="back wall")).to_contain_text("plane through")
    choose_step(page, "response")
    page.get_by_label("Go on by itself").check()
    expect(page.get_by_role("row", name="response")).to_contain_text("dark")
    snapshot(page, "guide-response")
    assert watched.complaints == []
