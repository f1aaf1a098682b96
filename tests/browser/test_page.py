"""What the page owes everybody: access, small files, a strict policy, and going on after mishaps."""

import gzip
import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.files.durable import write_text
from drivers.simulated import CameraFault, SimulatedCamera
from tests.app.rig.test_live_camera import SCENE
from tests.browser.conftest import PAGE, Opens, Station, snapshot
from tests.browser.test_look import DESK, keep, room

ROOT = PAGE.parents[1]
AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"
PAGES = ["Rig", "Calibrate", "Plan", "Capture", "Reconstruct", "Look", "Room", "New"]
THINGS = ("supply", "outlet", "surface", "wall", "object", "thermometer", "anemometer")


def packed_bytes(*patterns: str) -> int:
    files = [path for pattern in patterns for path in PAGE.parent.glob(pattern)]
    assert files
    return sum(len(gzip.compress(path.read_bytes(), 9)) for path in files)


def test_the_first_load_and_the_lazy_chunk_stay_small():
    assert packed_bytes("index.html", "assets/index-*.js", "assets/index-*.css") <= 70_000
    assert packed_bytes("assets/volume-*.js") <= 320_000


def go(page: Page, name: str) -> None:
    """Open a page, with all that it has: everything that a room may hold, a projector, a board, the import."""
    if name == "Room":
        page.get_by_role("button", name="Rig", exact=True).first.click()
        page.get_by_role("button", name="Edit room", exact=True).click()
        expect(page.locator("button.next")).to_have_text("Change the room")
    elif name == "New":
        page.get_by_role("button", name="Rig", exact=True).first.click()
        page.get_by_role("button", name="New experiment", exact=True).click()
        page.get_by_role("radio", name=re.compile("Simulated camera")).check()
        expect(page.locator("button.next")).to_have_text("Create the experiment")
        for thing in THINGS:
            page.get_by_role("button", name=f"Add {thing}", exact=True).click()
        page.get_by_role("radio", name=re.compile("A projector")).check()
        expect(page.get_by_role("group", name="object 1").first).to_be_visible()
    else:
        page.get_by_role("button", name=name, exact=True).first.click()
    if name == "Rig":
        page.get_by_role("combobox", name="Paper").select_option("a0")
        page.get_by_role("button", name="Make a board").click()
        expect(page.get_by_role("link", name="Board (PDF)")).to_be_visible()
    elif name == "Capture":
        page.locator("details.import").evaluate("details => (details.open = true)")
    elif name == "Look":
        expect(page.locator(".volume > div")).to_have_attribute("data-frame-ms", re.compile(r"\d"))
    expect(page.locator("main")).to_have_attribute("aria-label", name)


def begin(station: Station, page: Page) -> None:
    """The packaged room by its answers, with a result in whose room a desk stands."""
    page.locator(".door", has_text="New experiment").click()
    page.get_by_role("radio", name=re.compile("packaged room")).check()
    expect(page.locator("button.next")).to_have_text("Create the experiment")
    page.locator("button.next").click()
    expect(page.locator("button.next")).to_have_text("Calibrate")
    folders = station.app.state.services.folders
    keep(folders.open(folders.all()[0].name), "20260101T000000-standard", room(), "standard", 1.0, (DESK,))
    page.reload()
    expect(page.locator("footer")).to_contain_text("service connected")


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not installed; run `python web/hatch_build.py`")
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_nothing_on_any_page(station: Station, opens: Opens, theme: str):
    # axe is run from outside the policy; the page itself is watched under it in every other test.
    watched = opens(station.address, color_scheme=theme, bypass_csp=True)
    page = watched.page
    begin(station, page)
    page.evaluate(AXE.read_text(encoding="utf-8"))
    for name in PAGES:
        go(page, name)
        found = page.evaluate(
            "async () => (await axe.run()).violations.map(v => [v.id, v.nodes.map(n => n.html)])"
        )
        assert found == [], json.dumps(found, indent=1)
        snapshot(page, f"axe-{theme}-{name}")


@pytest.mark.parametrize("narrow_px", [1024, 390])
def test_every_page_fits_a_narrow_screen(station: Station, opens: Opens, narrow_px: int):
    page = opens(station.address, viewport={"width": 1024, "height": 768}, color_scheme="dark").page
    begin(station, page)
    page.set_viewport_size({"width": narrow_px, "height": 768})
    for name in PAGES:
        go(page, name)
        assert page.evaluate("document.documentElement.scrollWidth") <= narrow_px, name
        assert page.locator("header").bounding_box()["height"] < 120, name
        snapshot(page, f"{narrow_px}-{name}")


def test_a_page_without_a_token_says_how_to_get_one(station: Station, opens: Opens):
    page = opens(f"http://127.0.0.1:{station.port}/").page
    alert = page.get_by_role("alert")
    expect(alert).to_contain_text("Open the address that `airlens serve` prints")
    snapshot(page, "no-token")


def test_an_unplugged_camera_is_told_and_one_click_reconnects_it(station: Station, opens: Opens):
    page = opens(station.address).page
    page.locator("button.next").click()
    expect(page.locator("button.next")).to_have_text("Calibrate")
    services = station.app.state.services
    experiment = services.camera.status.experiment

    def faulty() -> SimulatedCamera:
        return SimulatedCamera(lambda: SCENE, seed=1, faults=lambda n: CameraFault.UNPLUG if n == 9 else None)

    services.camera.open(experiment, faulty)
    expect(page.locator("main")).to_contain_text("unplugged")
    snapshot(page, "camera-unplugged")
    page.locator("button.next", has_text="Reconnect the camera").click()
    expect(page.locator("footer")).to_contain_text("camera ready")


def test_the_page_goes_on_by_itself_after_the_service_was_restarted(station: Station, opens: Opens):
    page = opens(station.address).page
    page.locator("button.next").click()
    expect(page.locator("button.next")).to_have_text("Calibrate")
    station.stop()
    expect(page.locator("footer")).to_contain_text("service not reached")
    snapshot(page, "service-away")
    station.start()
    expect(page.locator("footer")).to_contain_text("service connected")
    page.locator("button.next").click()
    expect(page.get_by_role("row", name="back wall")).to_contain_text("plane through")


def test_what_was_being_read_when_the_service_went_is_read_once_it_is_back(station: Station, opens: Opens):
    page = opens(station.address).page
    begin(station, page)
    page.get_by_role("button", name="Look", exact=True).click()
    painted = page.locator(".slice canvas").first
    expect(painted).to_have_attribute("data-painted", re.compile(r"\d"))
    # The editor's program is there already.
    go(page, "Room")
    page.get_by_role("button", name="Rig", exact=True).click()
    footer, alert = page.locator("footer"), page.get_by_role("alert")
    for there, is_back in (
        ("Look", lambda: expect(painted).to_have_attribute("data-painted", re.compile(r"\d"))),
        ("New", lambda: expect(page.get_by_role("radio", name=re.compile("packaged"))).to_be_visible()),
        ("Room", lambda: expect(page.locator("button.next")).to_have_text("Change the room")),
    ):
        station.stop()
        expect(footer).to_contain_text("service not reached")
        if there == "Look":
            page.get_by_role("button", name="Look", exact=True).click()
        else:
            button = {"New": "New experiment", "Room": "Edit room"}[there]
            page.get_by_role("button", name=button, exact=True).click()
        expect(alert).to_contain_text("The service does not answer")
        station.start()
        expect(footer).to_contain_text("service connected")
        is_back()
        expect(alert).to_have_count(0)
        page.get_by_role("button", name="Rig", exact=True).click()


def test_a_capture_is_taken_as_its_fields_say_and_is_discarded_by_two_clicks(station: Station, opens: Opens):
    page = opens(station.address).page
    page.locator("button.next").click()
    page.locator("button.next", has_text="Calibrate").click()
    page.get_by_role("button", name="Capture", exact=True).click()
    frames = page.get_by_role("spinbutton", name="Frames to average")
    frames.fill("3")
    page.get_by_role("button", name="Rig", exact=True).click()
    page.locator("button.next", has_text="Take the reference").click()
    expect(frames).to_have_value("3")
    taken = page.locator(".library li")
    expect(taken).to_contain_text("3 frames")
    page.get_by_role("button", name="Discard", exact=True).click()
    page.get_by_role("button", name="Keep", exact=True).click()
    page.get_by_role("button", name="Discard", exact=True).click()
    snapshot(page, "discard")
    expect(taken).to_contain_text("3 frames")
    page.get_by_role("button", name="Discard for good").click()
    expect(page.locator(".library")).to_contain_text("No captures yet.")


def test_a_capture_goes_on_while_no_page_is_open(station: Station, opens: Opens):
    page = opens(station.address).page
    page.locator("button.next").click()
    expect(page.locator("button.next")).to_have_text("Calibrate")
    page.get_by_role("button", name="Capture", exact=True).click()
    page.get_by_role("button", name="Take reference").click()
    expect(page.locator(".desk")).to_contain_text("reference")
    page.close()
    again = opens(station.address).page
    again.get_by_role("button", name="Capture", exact=True).click()
    expect(again.locator(".library")).to_contain_text("100 frames")


def test_text_of_others_is_shown_and_never_run(station: Station, opens: Opens):
    watched = opens(station.address)
    page = watched.page
    page.locator("button.next").click()
    expect(page.locator("button.next")).to_have_text("Calibrate")
    services = station.app.state.services
    text = "<img src=x onerror=\"document.title='owned'\">"
    folder: Path = services.folders.all()[0]
    settings = folder / "experiment.toml"
    # Whole at once: the page is reading this file all the time.
    write_text(settings, settings.read_text().replace('title = "Simulated room"', f"title = '''{text}'''"))
    page.reload()
    expect(page.locator("main")).to_contain_text(text)
    assert page.title() == "airlens"
    assert watched.complaints == []
