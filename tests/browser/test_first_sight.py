"""A new user: what an empty service says, and how many clicks there are to the moving room."""

import re

from playwright.sync_api import expect

from app.client import Client
from app.files.durable import write_text
from tests.browser.conftest import Opens, Station, snapshot

MOST = 6
# A whole `standard`, beside another test on the other core.
SOLVED_WITHIN_S = 400.0


def test_an_empty_service_says_what_it_does_and_has_three_doors(station: Station, opens: Opens):
    watched = opens(station.address)
    page = watched.page
    expect(page.locator("#welcome-title")).to_have_text("See and measure the air in a room with one camera")
    expect(page.locator(".steps li")).to_have_count(4)
    assert page.locator(".steps svg").count() == 4
    doors = page.locator(".door")
    expect(doors.locator("b")).to_have_text(
        ["Try it on a simulated room", "New experiment for your own rig", "Open pictures"]
    )
    snapshot(page, "first-sight")
    doors.nth(1).click()
    expect(page.locator("main")).to_have_attribute("aria-label", "New")
    assert watched.complaints == []


def test_the_door_to_pictures_leads_to_where_they_are_dropped(station: Station, opens: Opens):
    watched = opens(station.address)
    page = watched.page
    page.locator(".door", has_text="Open pictures").click()
    expect(page.get_by_role("radio", name=re.compile("whose pictures I bring"))).to_be_checked()
    expect(page.locator("button.next")).to_have_text("Create the experiment")
    page.locator("button.next").click()
    expect(page.locator("main")).to_have_attribute("aria-label", "Capture")
    expect(page.get_by_label("Reference: still air").last).to_be_visible()
    assert watched.complaints == []


def test_six_clicks_lead_from_nothing_to_the_moving_room(station: Station, opens: Opens):
    page = opens(station.address).page
    clicks = 0

    def click(words: str, within_s: float = 100.0) -> None:
        nonlocal clicks
        button = page.locator("button.next") if clicks else page.locator(".door").first
        expect(button).to_contain_text(re.compile(words), timeout=1e3 * within_s)
        expect(button).to_be_enabled()
        button.click()
        clicks += 1

    click("Try it")
    expect(page.locator("button.next")).to_have_text("Calibrate")
    # A grid that any machine solves within the test's time.
    folder = station.app.state.services.folders.all()[0]
    settings = folder / "experiment.toml"
    write_text(settings, settings.read_text().replace('grid = "auto"', "grid = 8"))
    click("Calibrate")
    click("Take the reference")
    click("Take the flow")
    click("^Reconstruct$")
    click("Look", within_s=SOLVED_WITHIN_S)
    place = page.locator(".volume > div")
    expect(place).to_have_attribute("data-frame-ms", re.compile(r"\d"))
    page.emulate_media(reduced_motion="no-preference")
    assert clicks <= MOST
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        fields = {
            one.name for one in client.result(folder.name, client.results(folder.name)[0].result).fields
        }
    # It moves by its velocity, and what follows from that came with it.
    assert {"u", "v", "w", "draught_rate", "draught_rate_high", "age"} <= fields
    expect(page.locator(".room3d")).to_contain_text("speed of lines and arrows")
    snapshot(page, "six-clicks")
