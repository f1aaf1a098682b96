"""Pictures that another camera took are dropped on the page, and a result comes of them."""

import base64
import re
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import JSHandle, Locator, Page, Route, expect

from app.client import Client
from tests.browser.conftest import Opens, Station, snapshot
from tests.browser.test_faults import go_to
from tests.browser.test_story import PAINTED, next_step
from tests.browser.two_views import VIEWS, two_views

FRAMES = 4
COUNTS = 4095
# What a browser hands to a page with files from the operator's desktop.
HELD = """files => {
    const held = new DataTransfer();
    for (const { name, bytes } of files) {
        const raw = Uint8Array.from(atob(bytes), letter => letter.charCodeAt(0));
        held.items.add(new File([raw], name, { type: "image/png" }));
    }
    return held;
}"""


def held(page: Page, files: list[Path]) -> JSHandle:
    """The files as they are dragged over the page."""
    sent = [{"name": file.name, "bytes": base64.b64encode(file.read_bytes()).decode()} for file in files]
    return page.evaluate_handle(HELD, sent)


def drop(place: Locator, files: list[Path]) -> bool:
    """Hold files over a place and let go; whether the browser would open them instead of the page."""
    files_held = held(place.page, files)
    for kind in ("dragenter", "dragover"):
        place.dispatch_event(kind, {"dataTransfer": files_held})
    return place.evaluate(
        "(place, dataTransfer) => place.dispatchEvent("
        "new DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true }))",
        files_held,
    )


def seen_elsewhere(client: Client, name: str, folder: Path) -> dict[str, list[Path]]:
    """Frames of the simulated room as another camera's program would have written them, 12 bits in PNGs."""
    draw = np.random.default_rng(0)
    made: dict[str, list[Path]] = {}
    for role in ("reference", "flow"):
        client.start_capture(name, role, frames=8)
        while client.running_capture().state == "running":
            time.sleep(0.1)
        taken = next(one for one in client.captures(name) if one.role == role)
        mean = COUNTS * client.capture_image(name, taken.capture)
        made[role] = [folder / f"{role}{number}.png" for number in range(FRAMES)]
        for file in made[role]:
            counts = np.clip(np.rint(mean + draw.normal(0, 5, mean.shape)), 0, COUNTS)
            cv2.imwrite(str(file), counts.astype(np.uint16))
        client.discard_capture(name, taken.capture)
    return made


def test_dropped_pictures_become_a_result(station: Station, opens: Opens, tmp_path: Path):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=256).experiment
        client.connect_camera(name)
        client.calibrate(name)
        files = seen_elsewhere(client, name, tmp_path)
        assert client.captures(name) == []
        client.disconnect_camera()
    watched = opens(station.address)
    page = watched.page
    go_to(page, "Capture")
    page.get_by_text("Import pictures that another camera took").click()
    reference = page.get_by_role("group", name="Reference: still air")
    flow = page.get_by_role("group", name="Flow: the air moving")
    # Beside the fields nothing is taken, and the page stays.
    assert not drop(page.locator("main"), files["flow"])
    expect(page.get_by_role("button", name="Import 0 files")).to_be_disabled()
    assert not drop(reference, files["reference"][::-1])
    expect(reference).to_contain_text("4 files")
    assert reference.locator("input").evaluate("field => field.files.length") == 4
    flow.dispatch_event("dragover", {"dataTransfer": held(page, files["flow"])})
    expect(flow).to_have_class(re.compile("holding"))
    snapshot(page, "dropping")
    assert not drop(flow, files["flow"])
    expect(flow).to_contain_text("4 files")
    expect(flow).not_to_have_class(re.compile("holding"))
    page.get_by_label("Bits of a count").fill("12")
    page.get_by_role("button", name="Import 8 files").click()
    expect(page.locator(".library li")).to_have_count(2)
    for role in ("reference", "flow"):
        expect(page.locator(".library li", has_text=role)).to_contain_text("4 frames, 256 × 192 px")
    snapshot(page, "dropped")
    go_to(page, "Reconstruct")
    page.get_by_role("radio", name=re.compile("^draft")).check()
    next_step(page, "Reconstruct")
    next_step(page, "Look at the result")
    expect(page.locator(".slice canvas").first).to_have_attribute("data-painted", PAINTED)
    snapshot(page, "dropped-result")
    assert watched.complaints == []


def frames_of(parent: Path, cols: int, seed: int) -> list[Path]:
    """Pictures that a camera took, 72 rows each."""
    draw = np.random.default_rng(seed)
    parent.mkdir()
    files = [parent / f"{number}.png" for number in range(FRAMES)]
    for file in files:
        cv2.imwrite(str(file), draw.integers(0, COUNTS, (72, cols)).astype(np.uint16))
    return files


def test_each_camera_has_its_own_pictures_and_none_are_lost(station: Station, opens: Opens, tmp_path: Path):
    two_views(station, camera_px=96)
    wide, *taken = (frames_of(tmp_path / f"{n}", 96 if n else 100, n) for n in range(5))
    watched = opens(station.address)
    page, library = watched.page, watched.page.locator(".library li")
    go_to(page, "Capture")
    page.get_by_text("Import pictures that another camera took").click()
    section, camera = page.locator("details.import"), page.get_by_label("Camera that took them")
    field = page.get_by_role("group", name="Reference: still air").locator("input")
    field.set_input_files(taken[0])
    camera.select_option(f"{VIEWS[1]}: wall x_max")
    expect(section).to_contain_text(f"{VIEWS[0]}: 4, {VIEWS[1]}: 0.")
    assert field.evaluate("field => field.files.length") == 0
    # Those of another camera are refused by their size; all files stay where they were put.
    field.set_input_files(wide)
    page.get_by_role("button", name="Import 8 files").click()
    expect(page.get_by_role("alert")).to_contain_text(f"100 x 72 px; the camera '{VIEWS[1]}'")
    snapshot(page, "import-two-refused")
    camera.select_option(f"{VIEWS[0]}: wall y_max")
    expect(field).to_have_js_property("files.length", 4)
    camera.select_option(f"{VIEWS[1]}: wall x_max")
    field.set_input_files(taken[1])
    page.get_by_role("button", name="Import 8 files").click()
    expect(library.get_by_role("img")).to_have_count(1)
    expect(library).to_have_count(1)
    # One camera alone: the capture waits, and the other camera is next.
    field = page.get_by_role("group", name="Flow: the air moving").locator("input")
    camera.select_option(f"{VIEWS[0]}: wall y_max")
    field.set_input_files(taken[2])
    page.get_by_role("button", name="Import 4 files").click()
    expect(page.locator(".library")).to_contain_text(f"There is no picture yet of {VIEWS[1]}")
    expect(camera).to_have_value(VIEWS[1])
    snapshot(page, "import-two-waiting")
    field.set_input_files(taken[3])
    page.get_by_role("button", name="Import 4 files").click()
    expect(library.get_by_role("img")).to_have_count(2)
    expect(library).to_have_count(2)
    assert [one for one in watched.complaints if "422" not in one] == []


@pytest.fixture
def looking(station: Station, opens: Opens, tmp_path: Path) -> Iterator[tuple[Page, Client, str, str]]:
    """The page with four references chosen for each of two cameras; the experiment, and another one."""
    own = two_views(station, camera_px=96)
    with Client(f"http://127.0.0.1:{station.port}", station.token) as client:
        other = client.create_experiment("Another room", camera_px=96).experiment
        watched = opens(station.address)
        watched.page.get_by_label("Experiment", exact=True).select_option(own)
        go_to(watched.page, "Capture")
        watched.page.get_by_text("Import pictures that another camera took").click()
        for number, wall in enumerate(("y_max", "x_max")):
            camera = watched.page.get_by_label("Camera that took them")
            camera.select_option(f"{VIEWS[number]}: wall {wall}")
            reference(watched.page).set_input_files(frames_of(tmp_path / f"{number}", 96, number))
        yield watched.page, client, own, other
        assert watched.complaints == []


def reference(page: Page) -> Locator:
    return page.get_by_role("group", name="Reference: still air").locator("input")


def test_chosen_pictures_wait_while_another_experiment_or_page_is_looked_at(
    looking: tuple[Page, Client, str, str], tmp_path: Path
):
    page, _, own, other = looking
    field, chosen = reference(page), page.get_by_label("Experiment", exact=True)
    chosen.select_option(other)
    expect(page.get_by_role("button", name="Import 0 files")).to_be_disabled()
    expect(field).to_have_js_property("files.length", 0)
    field.set_input_files(frames_of(tmp_path / "other", 96, 2)[:3])
    chosen.select_option(own)
    expect(page.locator("details.import")).to_contain_text(f"{VIEWS[0]}: 4, {VIEWS[1]}: 4.")
    go_to(page, "Rig")
    go_to(page, "Capture")
    expect(page.get_by_role("button", name="Import 8 files")).to_be_visible()
    expect(field).to_have_js_property("files.length", 4)
    snapshot(page, "import-kept")
    page.get_by_role("button", name="Choose none").click()
    expect(page.get_by_role("button", name="Import 0 files")).to_be_disabled()
    expect(field).to_have_js_property("files.length", 0)
    chosen.select_option(other)
    expect(page.get_by_role("button", name="Import 3 files")).to_be_visible()


def test_pictures_go_to_the_experiment_that_they_were_chosen_for(looking: tuple[Page, Client, str, str]):
    page, client, own, other = looking
    chosen = page.get_by_label("Experiment", exact=True)
    held_back: list[Route] = []
    page.route("**/api/uploads?*", lambda one: held_back.append(one), times=1)
    with page.expect_request("**/api/uploads?*"):
        page.get_by_role("button", name="Import 8 files").click()
    chosen.select_option(other)
    expect(page.get_by_role("button", name="Import 0 files")).to_be_disabled()
    with page.expect_response("**/captures/imported"):
        held_back[0].continue_()
    assert [one.state for one in client.captures(own)] == ["finished"]
    assert client.captures(other) == []
    chosen.select_option(own)
    expect(page.locator(".library li")).to_have_count(1)
    expect(page.get_by_role("button", name="Import 0 files")).to_be_disabled()
