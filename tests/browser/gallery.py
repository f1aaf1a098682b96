"""Takes a picture of every page, in light and dark, at three sizes, for somebody to look at.

    python -m tests.browser.gallery FOLDER [--plan]

A simulated rig lit by its projector, calibrated, with captures, two results, a job and (--plan) a plan.
"""

import argparse
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Page, expect, sync_playwright

from app.client import Client
from tests.browser.conftest import CHROMIUM, FLAGS, Station
from tests.browser.test_look import keep, room

PAGES = ("Rig", "Calibrate", "Plan", "Capture", "Reconstruct", "Look")
SIZES = ((390, 844), (1024, 768), (1440, 900))


def furnish(station: Station, planned: bool) -> None:
    """An experiment in the middle of its work."""
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=300) as client:
        made = client.create_experiment("Room with a warm jet", light="projector").experiment
        client.connect_camera(made)
        client.connect_projector(made)
        for _ in range(3):
            client.take_guided(made)
            while client.guide(made).state == "running":
                time.sleep(0.2)
        for role in ("reference", "flow"):
            client.start_capture(made, role, frames=8)
            while client.running_capture().state == "running":
                time.sleep(0.2)
        if planned:
            client.submit_job("plan", {}, experiment=made)
        job = client.submit_job("noise-study", {"trials": 300, "size_px": 64}, title="A study of noise").job
        while client.job(job).state != "done" or any(j.state == "running" for j in client.jobs()):
            time.sleep(0.5)
        experiment = station.app.state.services.folders.open(made)
        keep(experiment, "20260101T000000-standard", room(), "standard", 1.0)
        keep(experiment, "20260102T000000-draft", room(), "draft", 3.0)


def shoot(page: Page, folder: Path, name: str) -> None:
    """Every page, whole; sticky parts where they are at the top."""
    page.goto(page.url.split("#")[0] + "#/new")
    page.get_by_role("radio", name="packaged room").check()
    expect(page.locator("button.next")).to_have_text("Create the experiment")
    page.screenshot(path=str(folder / f"0-New-{name}.png"), full_page=True)
    for number, title in enumerate(PAGES, 1):
        page.locator("nav").get_by_role("button", name=title).click()
        expect(page.locator("main")).to_have_attribute("aria-label", title)
        page.wait_for_timeout(2500)
        page.screenshot(path=str(folder / f"{number}-{title}-{name}.png"))
        tall = page.evaluate("document.documentElement.scrollHeight > innerHeight + 8")
        if tall:
            page.add_style_tag(content="header, footer { position: static !important }")
            page.screenshot(path=str(folder / f"{number}-{title}-{name}-whole.png"), full_page=True)
            page.evaluate("document.head.lastElementChild.remove()")


def main() -> None:
    """Parse the options and take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--plan", action="store_true")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as data, sync_playwright() as playwright:
        station = Station(Path(data))
        station.start()
        furnish(station, options.plan)
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for theme in ("light", "dark"):
            for width, height in SIZES:
                page = browser.new_page(
                    viewport={"width": width, "height": height}, color_scheme=theme, bypass_csp=True
                )
                page.goto(station.address)
                expect(page.locator("footer")).to_contain_text("service connected")
                shoot(page, options.folder, f"{theme}-{width}")
                page.close()
        browser.close()
        station.stop()


if __name__ == "__main__":
    main()
