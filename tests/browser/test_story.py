"""The operator's story in the browser: from an empty bench to an exported volume of air."""

import re
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.browser.conftest import Opens, Station, snapshot

PAINTED = re.compile(r"\d+")


def next_step(page: Page, label: str) -> None:
    """Press the one button that says what to do next."""
    button = page.locator("button.next")
    expect(button).to_have_text(label)
    button.click()


def test_from_an_empty_bench_to_an_export(station: Station, opens: Opens):
    watched = opens(station.address)
    page = watched.page
    next_step(page, "Start a simulated rig")
    expect(page.locator("canvas.picture")).to_have_attribute("data-frames", re.compile(r"\d\d"))
    snapshot(page, "1-rig")
    next_step(page, "Calibrate")
    expect(page.get_by_role("row", name="back wall")).to_contain_text("plane through")
    snapshot(page, "2-calibrate")
    next_step(page, "Take the reference")
    next_step(page, "Take the flow")
    expect(page.locator(".library li")).to_have_count(2)
    snapshot(page, "3-capture")
    # The quickest way: `auto` would march this room, which takes minutes.
    page.get_by_role("button", name="Reconstruct", exact=True).first.click()
    page.get_by_role("radio", name=re.compile("^draft")).check()
    next_step(page, "Reconstruct")
    growing = page.locator(".growing")
    expect(growing.locator("canvas[aria-label]")).to_have_attribute("data-painted", "1")
    expect(growing.locator(".bar")).to_contain_text(re.compile(r"K\s*above still air"))
    # The bar's ends are the picture's coldest and warmest colour.
    colours = """canvas => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      return Array.from({ length: data.length / 4 }, (_, n) => [...data.slice(4 * n, 4 * n + 3)]);
    }"""
    bar = growing.locator(".bar canvas").evaluate(colours)
    painted = growing.locator("canvas[aria-label]").evaluate(colours)
    assert bar[0] in painted
    assert bar[-1] in painted
    snapshot(page, "4-reconstruct")
    next_step(page, "Look at the result")
    expect(page.locator(".slice canvas").first).to_have_attribute("data-painted", PAINTED)
    snapshot(page, "5-look")
    with page.expect_download() as download:
        next_step(page, "Export NetCDF")
    assert Path(download.value.path()).stat().st_size > 1000
    assert watched.complaints == []


def test_the_same_by_keyboard_alone_without_webgl(station: Station, opens: Opens, chromium_without_gl):
    watched = opens(station.address, browser=chromium_without_gl, color_scheme="dark")
    page = watched.page
    for label in ("Start a simulated rig", "Calibrate", "Take the reference", "Take the flow"):
        press(page, label)
    page.locator("body").press("5")
    page.get_by_role("radio", name=re.compile("^draft")).focus()
    page.keyboard.press("Space")
    press(page, "Reconstruct")
    press(page, "Look at the result")
    expect(page.locator(".slice canvas").first).to_have_attribute("data-painted", PAINTED)
    expect(page.get_by_text("no WebGL 2")).to_be_visible()
    page.locator(".slice input").first.focus()
    before = page.locator(".slice label").first.inner_text()
    page.keyboard.press("ArrowRight")
    expect(page.locator(".slice label").first).not_to_have_text(before)
    page.locator("body").press("5")
    expect(page.locator("main")).to_have_attribute("aria-label", "Reconstruct")
    page.locator("body").press("6")
    expect(page.locator(".slice canvas").first).to_have_attribute("data-painted", PAINTED)
    snapshot(page, "6-look-dark-no-webgl")
    with page.expect_download():
        press(page, "Export NetCDF")
    assert watched.complaints == []


def press(page: Page, label: str) -> None:
    """Tab to the one button that says what to do next, then press Enter."""
    button = page.locator("button.next")
    expect(button).to_have_text(label)
    expect(button).to_be_enabled()
    for _ in range(60):
        page.keyboard.press("Tab")
        if button.evaluate("element => element === document.activeElement"):
            break
    page.keyboard.press("Enter")
