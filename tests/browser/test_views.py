"""Several cameras on the page: described, changed, seen side by side, taken at once, and one of them again alone."""

import re

import pytest
from playwright.sync_api import expect

from app.errors import BadInputError
from app.experiment.captures import load_capture
from app.experiment.printed import read_printed
from app.rig.open import open_camera
from app.rig.patterns import pattern_picture
from app.sheets.pattern import choose_pattern
from drivers.display import picture_digest
from tests.browser.conftest import Opens, Station, snapshot
from tests.browser.test_faults import go_to
from tests.browser.two_views import VIEWS, two_views


def test_a_camera_that_failed_is_taken_alone_and_all_are_seen_and_taken_at_once(
    station: Station, opens: Opens, monkeypatch: pytest.MonkeyPatch
):
    def broken(found, air, view=0, moment=None):
        if view == 1:
            raise BadInputError("The second camera does not answer.")
        return open_camera(found, air, view, moment)

    made = two_views(station)
    watched = opens(station.address)
    page = watched.page
    go_to(page, "Capture")
    page.get_by_label("Frames to average").fill("4")
    with monkeypatch.context() as patch:
        patch.setattr(station.app.state.services.desk, "_opener", broken)
        page.get_by_role("button", name="Take reference").click()
        expect(page.locator(".desk")).to_contain_text("The second camera does not answer.")
    library = page.locator(".library")
    missing = library.get_by_role("group", name=VIEWS[1])
    expect(missing).to_contain_text("There is no picture yet of camera at x_max")
    snapshot(page, "views-missing")
    missing.get_by_role("button", name=f"Take {VIEWS[1]}").click()
    # Whole now; of a whole one any camera can be taken again, into a capture of its own.
    expect(library.get_by_role("img")).to_have_count(1)
    library.get_by_role("button", name=f"Take {VIEWS[0]} again").click()
    expect(library.get_by_role("img")).to_have_count(2)
    # What every camera sees, side by side; and all of them at once.
    for name in VIEWS:
        sight = page.get_by_role("figure", name=f"Live picture of {name}", exact=True)
        expect(sight.locator("canvas")).to_have_attribute("data-frames", re.compile(r"\d+"))
    page.get_by_label("All cameras at once").check()
    page.get_by_role("button", name="Take reference").click()
    expect(library.get_by_role("img")).to_have_count(3)
    experiment = station.app.state.services.folders.open(made)
    newest = load_capture(experiment.latest_capture("reference"))
    assert newest.manifest["origin"]["cameras"]["at_once"] is True
    snapshot(page, "views-retaken")
    # One that is lost says so in its place, and is connected again there.
    station.app.state.services.cameras.of(1).give_up("It was unplugged.")
    lost = page.get_by_role("figure", name=f"Live picture of {VIEWS[1]}", exact=True)
    expect(lost).to_contain_text("It was unplugged.")
    snapshot(page, "views-lost")
    lost.get_by_role("button", name=f"Connect {VIEWS[1]}").click()
    expect(lost.locator("canvas")).to_have_attribute("data-frames", re.compile(r"\d+"))
    # The shift by the camera that is chosen, and exposure and gain of that one alone.
    page.get_by_label("by the camera of").select_option(VIEWS[1])
    with page.expect_response(lambda one: "/devices/camera/shift?view=1" in one.url) as asked:
        page.get_by_label("Shift since the reference").check()
    assert asked.value.ok
    page.get_by_label("Shift since the reference").uncheck()
    cameras = station.app.state.services.cameras
    before_s = cameras.of(0).status.exposure_s
    go_to(page, "Rig")
    page.get_by_label("View").select_option(f"{VIEWS[1]}: wall x_max")
    page.get_by_label("Exposure [ms]").fill("33.333")
    page.get_by_role("button", name="Set", exact=True).click()
    expect(page.locator("section.side")).to_contain_text("33.333 ms")
    assert cameras.of(1).status.exposure_s == pytest.approx(0.033333)
    assert cameras.of(0).status.exposure_s == before_s
    snapshot(page, "views-rig")
    assert watched.complaints == []


def test_a_further_camera_is_added_changed_and_removed(station: Station, opens: Opens):
    watched = opens(station.address)
    page = watched.page
    page.get_by_role("button", name="New experiment").click()
    page.get_by_role("radio", name=re.compile("packaged room")).click()
    page.get_by_role("button", name="Add a camera").click()
    view = page.get_by_role("group", name="camera 2")
    expect(view).to_contain_text("Its picture covers")
    view.get_by_label("Distance to its wall").fill("3 kg")
    expect(view).to_contain_text("'kg' is no unit of length")
    expect(page.locator("button.next")).to_have_text("1 to correct")
    view.get_by_label("Distance to its wall").fill("3.2")
    view.get_by_label("Looks at the wall").select_option("x_min")
    view.get_by_label("Pattern on its wall").select_option("projector")
    # It begins before its own wall, with nothing to correct.
    expect(page.locator("button.next")).to_have_text("Create the experiment")
    expect(view).not_to_contain_text("behind the wall")
    view.get_by_label("Projector's lens, x").fill("-1")
    expect(view).to_contain_text("at or behind the wall x_min")
    snapshot(page, "views-wrong")
    view.get_by_label("Projector's lens, x").fill("3")
    page.locator("button.next", has_text="Create the experiment").click()
    # From here on it is an experiment of two cameras, whose room can be edited.
    expect(page.locator("main")).to_have_attribute("aria-label", "Rig")
    page.get_by_role("button", name="Edit room").click()
    view = page.get_by_role("group", name="camera 2")
    view.get_by_label("What it is called").fill("left")
    expect(page.get_by_role("group", name="left")).to_contain_text("Its picture covers")
    snapshot(page, "views-edited")
    page.locator("button.next", has_text="Change the room").click()
    expect(page.locator("main")).to_have_attribute("aria-label", "Rig")
    (found,) = station.app.state.services.folders.all()
    scene = station.app.state.services.folders.open(found.name).settings.scene
    assert [(one.name, one.wall) for one in scene.views] == [("camera", "y_max"), ("left", "x_min")]
    page.get_by_role("button", name="Edit room").click()
    page.get_by_role("button", name="Remove left").click()
    expect(page.get_by_role("group", name="left")).to_have_count(0)
    page.locator("button.next", has_text="Change the room").click()
    expect(page.locator("main")).to_have_attribute("aria-label", "Rig")
    assert len(station.app.state.services.folders.open(found.name).settings.scene.views) == 1
    expect(page.locator("footer")).to_contain_text("camera ready")
    assert watched.complaints == []


def test_each_projector_has_its_kiosk_and_its_pattern_on_rig(station: Station, opens: Opens):
    made = two_views(station, light="projector")
    watched = opens(station.address)
    page = watched.page
    go_to(page, "Rig")
    section = page.locator("section.projector")
    kiosk = section.get_by_role("link", name="Kiosk page")
    expect(kiosk).to_have_attribute("href", "/kiosk/page")
    section.get_by_label("Projector").select_option(f"of {VIEWS[1]}: wall x_max")
    expect(kiosk).to_have_attribute("href", "/kiosk/1/page")
    section.get_by_role("button", name="Show", exact=True).click()
    expect(section).to_contain_text("waiting")
    expect(section.get_by_role("img")).to_have_attribute("src", re.compile("view=1"))
    screens = station.app.state.services.screens
    experiment = station.app.state.services.folders.open(made)
    assert screens.of(1).wanted[0] == picture_digest(pattern_picture(experiment, "scene", 1))
    assert screens.of(0).wanted[0] == ""
    snapshot(page, "views-kiosk")
    assert watched.complaints == []


def test_each_projector_is_seen_switched_and_freed_on_rig(station: Station, opens: Opens):
    two_views(station, light="projector")
    watched = opens(station.address)
    page = watched.page
    go_to(page, "Rig")
    section, footer = page.locator("section.projector"), page.locator("footer")
    section.get_by_role("button", name="Connect projector").click()
    expect(footer).to_contain_text(f"projector of {VIEWS[0]} standby")
    section.get_by_label("Projector").select_option(f"of {VIEWS[1]}: wall x_max")
    expect(section).to_contain_text(f"{VIEWS[1]}: closed")
    section.get_by_role("button", name="Connect projector").click()
    section.get_by_role("button", name="Lamp on").click()
    expect(footer).to_contain_text(f"projector of {VIEWS[1]} on")
    section.get_by_role("button", name="Mute").click()
    expect(section.get_by_role("button", name="Mute")).to_have_attribute("aria-pressed", "true")
    section.get_by_label("Wire log").check()
    expect(section.locator(".wire")).to_contain_text("%1AVMT 11")
    expect(section).to_contain_text(f"{VIEWS[0]}: standby")
    snapshot(page, "views-projectors")
    projectors = station.app.state.services.projectors
    assert [one.report.said.muted for one in projectors.known] == [None, True]
    section.get_by_role("button", name="Free the line").click()
    expect(section).to_contain_text(f"{VIEWS[1]}: closed")
    assert [one.report.state for one in projectors.known] == ["standby", "closed"]
    assert watched.complaints == []


def test_each_wall_has_its_print_on_rig(station: Station, opens: Opens):
    made = two_views(station)
    folders = station.app.state.services.folders
    for view in VIEWS:
        choose_pattern(folders.folder(made), view)
    watched = opens(station.address)
    page = watched.page
    go_to(page, "Rig")
    for wall in ("y_max", "x_max"):
        page.get_by_role("button", name=f"Make the pattern of {wall}").click()
        expect(page.get_by_role("link", name=f"Pattern of {wall} (PDF)")).to_be_visible()
    with page.expect_download() as got:
        page.get_by_role("link", name="Pattern of x_max (PDF)").click()
    printed = read_printed(folders.open(made), "pattern", 1)
    assert printed is not None
    assert got.value.path().read_bytes() == folders.open(made).file(printed.file).read_bytes()
    snapshot(page, "views-prints")
    assert watched.complaints == []
