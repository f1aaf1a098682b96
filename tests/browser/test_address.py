"""Every page of every experiment has an address of its own, and each experiment its own camera."""

import re

from playwright.sync_api import Route, expect

from app.client import Client
from tests.browser.conftest import Opens, Station
from tests.browser.test_look import keep, room


def test_a_reload_and_the_way_back_keep_page_experiment_and_result(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        first = client.create_experiment("First room", camera_px=64).experiment
        client.create_experiment("Second room", camera_px=64)
    experiment = station.app.state.services.folders.open(first)
    keep(experiment, "20260101T000000-standard", room(), "standard", 1.0)
    keep(experiment, "20260102T000000-draft", room(), "draft", 1.0)
    page = opens(station.address).page
    page.get_by_label("Experiment").select_option(first)
    page.get_by_role("button", name="Look", exact=True).click()
    page.locator("label").filter(has_text=re.compile(r"^\s*Result")).locator("select").select_option(
        "20260101T000000-standard"
    )
    look = f"#/look/{first}/20260101T000000-standard"
    expect(page).to_have_url(re.compile(f"{re.escape(look)}$"))
    page.reload()
    expect(page.locator("main")).to_have_attribute("aria-label", "Look")
    expect(page.get_by_label("Experiment")).to_have_value(first)
    expect(page).to_have_url(re.compile(f"{re.escape(look)}$"))
    page.get_by_role("button", name="Capture", exact=True).click()
    expect(page).to_have_url(re.compile(f"#/capture/{first}$"))
    page.go_back()
    expect(page.locator("main")).to_have_attribute("aria-label", "Look")


def test_an_address_of_what_is_not_there_says_so_and_no_other_result_is_asked_for(
    station: Station, opens: Opens
):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        first = client.create_experiment("First room", camera_px=64).experiment
        second = client.create_experiment("Second room", camera_px=64).experiment
    experiment = station.app.state.services.folders.open(first)
    keep(experiment, "20260101T000000-standard", room(), "standard", 1.0)
    watched = opens(station.address)
    page = watched.page
    page.get_by_label("Experiment").select_option(first)
    page.get_by_role("button", name="Look", exact=True).click()
    expect(page.locator(".slice canvas").first).to_be_visible()
    page.evaluate(f"location.hash = '#/look/{second}'")
    expect(page.locator("main")).to_contain_text("There is no finished result yet")
    page.evaluate("location.hash = '#/look/%zz'")
    expect(page.get_by_role("alert")).to_contain_text("There is no experiment %zz.")
    expect(page.get_by_label("Experiment")).to_have_value(second)
    page.goto("about:blank")
    page.goto(f"{station.address.split('#')[0]}#/rig/nobody")
    expect(page.get_by_role("alert")).to_contain_text("There is no experiment nobody.")
    # The new experiment's page keeps the one that is chosen.
    page.get_by_label("Experiment").select_option(first)
    page.get_by_role("button", name="New experiment", exact=True).click()
    expect(page).to_have_url(re.compile(f"#/new/{first}$"))
    page.reload()
    expect(page.get_by_label("Experiment")).to_have_value(first)
    assert watched.complaints == []


def test_the_camera_of_one_experiment_is_not_shown_under_another(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        first = client.create_experiment("First room", camera_px=64).experiment
        second = client.create_experiment("Second room", camera_px=64).experiment
        client.connect_camera(first)
    page = opens(station.address).page
    page.get_by_label("Experiment").select_option(first)
    expect(page.locator("canvas.picture")).to_be_visible()
    page.get_by_label("Experiment").select_option(second)
    expect(page.locator("main")).to_contain_text("The camera is connected for “First room”")
    expect(page.locator("canvas.picture")).to_have_count(0)
    expect(page.locator("footer")).to_contain_text("camera closed")


def test_a_phone_shows_one_column_and_the_next_step(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment("A room", camera_px=64).experiment
    keep(station.app.state.services.folders.open(name), "20260101T000000-standard", room(), "standard", 1.0)
    page = opens(station.address, viewport={"width": 390, "height": 844}).page
    for title in ("Rig", "Calibrate", "Plan", "Capture", "Reconstruct", "Look"):
        page.get_by_role("button", name=title, exact=True).first.click()
        expect(page.locator("main")).to_have_attribute("aria-label", title)
        if title == "Look":
            expect(page.locator(".slice canvas").first).to_have_attribute("data-painted", re.compile(r"\d"))
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, title
        box = page.locator("button.next").bounding_box()
        assert box["x"] >= 0, title
        assert box["x"] + box["width"] <= 390, title


def test_a_page_chosen_before_the_first_answers_stays(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment("A room", camera_px=64).experiment
    keep(station.app.state.services.folders.open(name), "20260101T000000-standard", room(), "standard", 1.0)
    page = opens(station.address).page
    expect(page.locator("main")).to_have_attribute("aria-label", "Look")
    held: list[Route] = []

    def hold_the_first(route: Route) -> None:
        if held:
            route.continue_()
        else:
            held.append(route)

    page.route(re.compile(r"/experiments$"), hold_the_first)
    page.goto(page.url.split("#")[0].rstrip("/") + "/?again")
    page.get_by_role("button", name="Rig", exact=True).click()
    while not held:
        page.wait_for_timeout(20)
    held[0].continue_()
    expect(page.get_by_label("Experiment")).to_have_value(name)
    expect(page.locator("main")).to_have_attribute("aria-label", "Rig")
