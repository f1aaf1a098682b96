"""Before anybody measures: what would be seen, what it would cost, and what would help."""

import re

from playwright.sync_api import expect

from tests.browser.conftest import Opens, Station, snapshot


def test_a_plan_says_what_would_be_seen_and_what_each_preset_would_cost(station: Station, opens: Opens):
    watched = opens(station.address)
    page = watched.page
    page.locator("button.next").click()
    expect(page.locator("button.next")).to_have_text("Calibrate")
    page.get_by_role("button", name="Plan", exact=True).first.click()
    expect(page.get_by_text("No plan yet")).to_be_visible()
    page.locator("main form").get_by_role("button", name="Plan").click()
    expect(page.locator(".verdicts li").first).to_be_visible(timeout=200_000)
    # One verdict first, in the colour of what it says.
    sight = page.locator(".verdicts").get_attribute("data-sight")
    words = {"blind": "does not see", "weak": "weakly", "sees": "sees the expected air: "}
    expect(page.locator(".verdicts li").first).to_contain_text(words[str(sight)])
    canvas = page.locator(".shiftmap canvas")
    expect(canvas).to_have_attribute("data-painted", "1")
    canvas.hover()
    expect(page.locator(".shiftmap figcaption")).to_contain_text(re.compile(r"mpx, [\d.]+ times the noise"))
    expect(page.locator(".places .spot")).to_have_count(49)
    page.locator(".places .spot").nth(31).hover()
    expect(page.locator(".places figcaption")).to_contain_text(
        re.compile(r"m from the wall: the picture [\d.]+, a window [\d.]+, \d+ % of the wall")
    )
    expect(page.locator("main")).to_contain_text("Choices made by auto")
    snapshot(page, "plan")
    page.get_by_role("button", name="Reconstruct", exact=True).click()
    preset = page.locator(".choice", has=page.get_by_text("standard", exact=True))
    expect(preset).to_contain_text(re.compile(r"about [\d.]+ (s|min|h)|Not predicted: \w+"))
    snapshot(page, "reconstruct-predicted")
    assert watched.complaints == []
