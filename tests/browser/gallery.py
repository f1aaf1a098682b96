"""Takes a picture of every page, in light and dark, at three sizes, for somebody to look at.

    python -m tests.browser.gallery FOLDER [--plan]
    python -m tests.browser.gallery --readme web/page.png --experiment airlens-data/experiments/demo

A simulated rig lit by its projector, calibrated, with captures, two results, a job and (--plan) a plan. For the
README: Look alone, at the newest result of an experiment, such as the demo's.
"""

import argparse
import shutil
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Browser, Page, expect, sync_playwright

from app.client import Client
from tests.browser.conftest import CHROMIUM, FLAGS, Station
from tests.browser.test_look import PAINTED, keep, room

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


def shoot_for_readme(browser: Browser, station: Station, experiment: Path, picture: Path) -> None:
    """The page Look at an experiment's newest result, while the air moves."""
    shutil.copytree(experiment, station.app.state.services.folders.root / experiment.name)
    page = browser.new_page(
        viewport={"width": 1280, "height": 900},
        color_scheme="light",
        bypass_csp=True,
        reduced_motion="no-preference",
    )
    page.goto(station.address)
    page.locator("nav").get_by_role("button", name="Look").click()
    expect(page.locator("main")).to_have_attribute("aria-label", "Look")
    expect(page.locator(".volume > div")).to_have_attribute("data-moved", PAINTED)
    expect(page.locator(".slice canvas").first).to_have_attribute("data-painted", PAINTED)
    page.wait_for_timeout(10_000)
    page.screenshot(path=str(picture))


def shoot(page: Page, folder: Path, name: str) -> None:
    """Every page, whole; sticky parts where they are at the top."""
    page.goto(page.url.split("#")[0] + "#/new")
    page.get_by_role("radio", name="packaged room").check()
    expect(page.locator("button.next")).to_have_text("Create the experiment")
    page.add_style_tag(content="header, footer { position: static !important }")
    page.screenshot(path=str(folder / f"0-New-{name}.png"), full_page=True)
    page.evaluate("document.head.lastElementChild.remove()")
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


def shoot_all(browser: Browser, station: Station, folder: Path) -> None:
    """Every page in both themes at every size."""
    folder.mkdir(parents=True, exist_ok=True)
    for theme in ("light", "dark"):
        for width, height in SIZES:
            page = browser.new_page(
                viewport={"width": width, "height": height}, color_scheme=theme, bypass_csp=True
            )
            page.goto(station.address)
            expect(page.locator("footer")).to_contain_text("service connected")
            shoot(page, folder, f"{theme}-{width}")
            page.close()


def main() -> None:
    """Parse the options and take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--plan", action="store_true")
    parser.add_argument("--readme", type=Path, help="only the picture of README, to this file")
    parser.add_argument("--experiment", type=Path, help="with --readme: whose newest result is shown")
    options = parser.parse_args()
    if options.folder is None and options.readme is None:
        parser.error("give a folder, or --readme with a file")
    if options.readme is not None and options.experiment is None:
        parser.error("--readme shows a result: give --experiment with a solved experiment's folder")
    with tempfile.TemporaryDirectory() as data, sync_playwright() as playwright:
        station = Station(Path(data))
        station.start()
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        if options.readme is not None:
            shoot_for_readme(browser, station, options.experiment, options.readme)
        else:
            furnish(station, options.plan)
            shoot_all(browser, station, options.folder)
        browser.close()
        station.stop()


if __name__ == "__main__":
    main()
