"""A board before two cameras at once on Calibrate: seen side by side, taken, found on each, adjusted together."""

import re

import pytest
from playwright.sync_api import expect

from tests.app.calibrate.test_together import experiment, smaller
from tests.browser.conftest import Opens, Station, snapshot
from tests.browser.test_faults import go_to
from tests.calibration.test_together import rig


@pytest.mark.timeout(900)
def test_two_cameras_are_tied_by_one_board_without_the_command_line(station: Station, opens: Opens):
    experiment(station.app.state.services.folders.root / "two", smaller(rig(11)))
    watched = opens(station.address)
    page = watched.page
    go_to(page, "Calibrate")
    expect(page.get_by_role("heading", name="Cameras together")).to_be_visible()
    page.get_by_label("Places").fill("3")
    wanted = page.locator(".wanted", has_text="Place 1 of 3")
    expect(wanted).to_contain_text("hold the board where two cameras or more (a, b) see it whole")
    page.get_by_role("button", name="Adjust the cameras together").click()
    expect(page.get_by_role("alert")).to_contain_text("Nothing that more than one sees ties 'a' and 'b'")
    page.get_by_role("button", name="Take this board for both").click()
    for name in "ab":
        sight = page.get_by_role("figure", name=f"The board before {name}")
        expect(sight).to_contain_text("30 points found")
        expect(sight.locator("canvas")).to_have_attribute("data-frames", re.compile(r"\d+"))
        expect(sight.locator("circle.found")).to_have_count(30)
    expect(page.get_by_role("row", name="place_00")).to_contain_text("a: 30, b: 30")
    snapshot(page, "together-taken")
    page.get_by_role("button", name="Forget place_00").click()
    expect(page.get_by_role("row", name="place_00")).to_have_count(0)
    page.get_by_label("One place after the other").check()
    expect(page.get_by_text("All places that were asked for are there.")).to_be_visible()
    expect(page.get_by_role("row", name=re.compile("^place_"))).to_have_count(3)
    page.get_by_role("button", name="Adjust the cameras together").click()
    expect(page.get_by_text("Adjusted by 3 places of the board")).to_be_visible()
    expect(page.get_by_text(re.compile(r"a and b: \d\.\d{4} ± 0\.\d{4} m apart"))).to_be_visible()
    known = page.locator("section[aria-labelledby=known-title]")
    expect(known.get_by_role("row", name="views together")).to_contain_text("adjusted together by 3 boards")
    snapshot(page, "together-adjusted")
    # What a reload shows is what is kept.
    page.reload()
    expect(page.get_by_text(re.compile(r"a and b: \d\.\d{4} ± 0\.\d{4} m apart"))).to_be_visible()
    (refused,) = watched.complaints
    assert "422" in refused
    assert refused.endswith("/calibration/together")
