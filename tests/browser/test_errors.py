"""What the service refuses is shown on every page in its own words, with what to do next."""

import re
import shutil

from playwright.sync_api import Page, Route, expect

from app.client import Client
from tests.browser.conftest import Opens, Station
from tests.browser.test_faults import go_to
from tests.browser.test_look import keep, room


def told(page: Page, *words: str) -> None:
    """The one place for refusals says so; then it is put away."""
    alert = page.get_by_role("alert")
    for part in words:
        expect(alert).to_contain_text(part)
    alert.get_by_role("button", name="Dismiss").click()
    expect(alert).to_have_count(0)


def test_every_page_shows_a_refusal_in_the_services_words(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
        client.connect_camera(name)
        client.calibrate(name)
    experiment = station.app.state.services.folders.open(name)
    keep(experiment, "20260101T000000-standard", room(), "standard", 1.0)
    page = opens(station.address).page
    # It opens with what was found.
    expect(page.locator(".slice canvas").first).to_be_visible()

    go_to(page, "Rig")
    page.get_by_label("Gain").fill("100")
    page.get_by_role("button", name="Set", exact=True).click()
    told(page, "Gain 100 is not possible; expected 1 to 16.")
    expect(page.locator("footer")).to_contain_text("camera ready")

    go_to(page, "Calibrate")
    page.locator("details.board summary").click()
    page.get_by_label("Kind").select_option("charuco")
    page.get_by_label("Side of a marker [mm]").fill("200")
    page.get_by_role("button", name="Keep the board").click()
    told(page, "The markers are 0.2 m in squares of 0.1 m", "Measure the print and give both in metres.")

    go_to(page, "Plan")
    page.locator("main form input").first.fill("9000")
    page.locator("main form").evaluate("form => { form.noValidate = true }")
    page.locator("main form").get_by_role("button", name="Plan").click()
    told(page, "excess_k", "Correct the")

    go_to(page, "Look")
    expect(page.locator(".slice canvas").first).to_have_attribute("data-painted", re.compile(r"\d"))
    shutil.rmtree(experiment.results_folder)
    page.get_by_role("button", name="CSV", exact=True).click()
    told(page, "has no result", "List the parent resource to see what there is.")

    go_to(page, "Capture")
    page.get_by_role("spinbutton", name="Frames to average").fill("4")
    page.get_by_role("button", name="Take reference").click()
    expect(page.locator(".library")).to_contain_text("4 frames")
    shutil.rmtree(experiment.captures_folder)
    page.get_by_role("button", name="Discard", exact=True).click()
    page.get_by_role("button", name="Discard for good").click()
    told(page, "has no capture", "List the parent resource to see what there is.")


def test_an_older_action_that_succeeds_leaves_a_newer_refusal_in_place(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        client.connect_camera(client.create_experiment(camera_px=64).experiment)
    page = opens(station.address).page
    expect(page.locator("footer")).to_contain_text("camera ready")
    held: list[Route] = []
    page.route("**/results", lambda route: held.append(route))
    page.reload()
    expect(page.locator("button.next")).to_contain_text("Opening")
    page.get_by_label("Gain").fill("100")
    page.get_by_role("button", name="Set", exact=True).click()
    expect(page.get_by_role("alert")).to_contain_text("Gain 100 is not possible")
    for route in held:
        route.continue_()
    expect(page.locator("footer")).to_contain_text("service connected")
    told(page, "Gain 100 is not possible")


def test_the_board_s_form_waits_for_the_board_that_is_known(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
    page = opens(station.address).page
    held: list[Route] = []
    page.route(f"**/experiments/{name}", lambda route: held.append(route))
    go_to(page, "Calibrate")
    expect(page.locator("#guide-title")).to_be_visible()
    expect(page.get_by_role("button", name="1. camera")).to_be_visible()
    expect(page.locator("details.board")).to_have_count(0)
    for route in held:
        route.continue_()
    page.locator("details.board summary").click()
    expect(page.get_by_label("Kind")).to_be_visible()
    page.get_by_label("Kind").select_option("charuco")
    page.get_by_label("Side of a marker [mm]").fill("20")


def test_a_job_that_cannot_begin_says_why_in_the_queue(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
        page = opens(station.address).page
        go_to(page, "Reconstruct")
        client.submit_job("reconstruct", {"preset": "draft"}, experiment=name, title="Too early")
    expect(page.locator(".queue")).to_contain_text("has no finished reference capture. Take one:")
