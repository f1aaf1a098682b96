"""Looking at results: every field with its uncertainty, truth and error; two results; three dimensions."""

import dataclasses
import re
import time
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from app.client import Client
from app.experiment.folder import Experiment, read_manifest, save_settings, write_manifest
from app.experiment.found import Found
from app.experiment.results import write_result
from app.files.durable import write_json, write_text
from app.files.toml import to_plain
from app.simulate.rehearsal import SAMPLE_ROOM
from app.volume.file import read_volume
from core.estimate.diagnostics import doubtful
from core.objects import RoomObject
from core.result import Departures, Outcome, Solution
from core.scene import PointSensors
from tests.browser.conftest import Opens, Station, snapshot

PAINTED = re.compile(r"\d+")
COUNT = 32


def room() -> Solution:
    """The packaged room as a solver would hand it back: smoothed, and honest about its error."""
    truth = read_volume(SAMPLE_ROOM)
    every = [
        np.linspace(0, len(axis) - 1, COUNT).round().astype(int) for axis in (truth.x_m, truth.y_m, truth.z_m)
    ]
    at = np.ix_(*every)
    temperature = truth.temperature_k[at].astype(np.float64)
    error = 0.1 * np.random.default_rng(0).normal(size=temperature.shape)
    return Solution(
        *(np.linspace(axis[0], axis[-1], COUNT) for axis in (truth.x_m, truth.y_m, truth.z_m)),
        temperature_k=temperature + error,
        pressure_m2_s2=truth.pressure_m2_s2[at].astype(np.float64),
        velocity_m_s=truth.velocity_m_s[at].astype(np.float64),
        temperature_std_k=0.1 + 0 * error,
        outcome=Outcome.converged,
        solver_s=1.0,
        notes=("Straight rays: their bending is below a hundredth of the noise.",),
    )


DESK = RoomObject(name="desk", lower_m=(0.5, -0.75, 0.0), upper_m=(2.0, 0.75, 0.8))


def keep(
    experiment: Experiment,
    name: str,
    solution: Solution,
    preset: str,
    loss: float,
    objects: tuple[RoomObject, ...] = (),
) -> None:
    """Keep a result; `objects` stand in its room, and no air is in them."""
    folder = experiment.results_folder / name
    solution = solution.without_objects(objects)
    folder.mkdir(parents=True)
    write_result(folder / "result.nc", solution, {})
    write_text(
        folder / "history.jsonl", "".join(f'{{"step": {n}, "loss": {loss / n}}}\n' for n in range(1, 30))
    )
    write_text(folder / "report.html", "<h1>Report</h1>")
    write_json(folder / "result.json", {})
    settings = {
        "preset": preset,
        "solve": {"cells": 48, "rounds": len(preset)},
        "created": "2026-01-01T00:00:00+00:00",
        "settings": to_plain(experiment.settings),
    }
    settings["settings"]["scene"]["objects"] = [to_plain(one) for one in objects]
    write_manifest(folder, settings)


def another(place: Locator, known: set[bytes]) -> bytes:
    """The picture, once it shows something else than the ones before."""
    deadline_s = time.monotonic() + 100
    while (picture := place.screenshot()) in known:
        assert time.monotonic() < deadline_s, "it shows nothing else"
    return picture


def choose(page: Page, field: str, label: str = "Field") -> None:
    page.locator("label").filter(has_text=re.compile(rf"^\s*{label}")).locator("select").select_option(field)


def look_round(page: Page) -> None:
    """Each way to draw the room shows another picture, and it can be kept."""
    place = page.locator(".volume")
    expect(place.locator("[data-frame-ms]")).to_be_attached()
    expect(place).to_contain_text("supply")
    expect(place).to_contain_text("x [m]")
    expect(page.locator(".room3d")).to_contain_text("speed of lines and arrows")
    pictures = {"plane and streamlines": place.screenshot()}
    page.get_by_label("Streamlines").uncheck()
    pictures["plane"] = another(place, set(pictures.values()))
    page.get_by_role("checkbox", name="Plane across y").uncheck()
    for mode in ("Isosurface", "Arrows", "Volume"):
        page.get_by_label(mode, exact=True).check()
        pictures[mode] = another(place, set(pictures.values()))
        snapshot(page, f"look-{mode.lower()}")
        page.get_by_label(mode, exact=True).uncheck()
    page.get_by_role("checkbox", name="Plane across y").check()
    page.get_by_role("button", name="Top", exact=True).click()
    another(place, set(pictures.values()))
    with page.expect_download() as download:
        page.get_by_role("button", name="Picture", exact=True).click()
    assert Path(download.value.path()).read_bytes().startswith(b"\x89PNG")


def keep_files(page: Page) -> None:
    """The exports come as files of their kind, and the report opens."""
    for label, start in {"HDF5": b"\x89HDF", "OpenFOAM": b"PK", "PNG": b"\x89PNG", "CSV": b"x [m]"}.items():
        with page.expect_download() as download:
            page.get_by_role("button", name=label, exact=True).click()
        assert Path(download.value.path()).read_bytes().startswith(start), label
    with page.context.expect_page() as opened:
        page.get_by_role("button", name="Report", exact=True).click()
    expect(opened.value.get_by_role("heading")).to_have_text("Report")


def test_fields_truth_two_results_and_three_dimensions(station: Station, opens: Opens, tmp_path: Path):
    watched = opens(station.address)
    page = watched.page
    page.locator("button.next").click()
    expect(page.locator("button.next")).to_have_text("Calibrate")
    folders = station.app.state.services.folders
    experiment = folders.open(folders.all()[0].name)
    found = room()
    keep(experiment, "20260101T000000-standard", found, "standard", 1.0)
    warmer = dataclasses.replace(found, temperature_k=found.temperature_k + 0.2)
    keep(experiment, "20260102T000000-draft", warmer, "draft", 3.0)
    page.reload()
    page.get_by_role("button", name="Look", exact=True).click()
    slices = page.locator(".slice canvas")
    expect(slices.first).to_have_attribute("data-painted", PAINTED)
    expect(page.locator("main")).to_contain_text(
        "T: rms error over the rms departure from each height's mean"
    )
    choose(page, "T_error")
    expect(page.locator(".bar").first).to_contain_text("found minus true")
    snapshot(page, "look-error")
    choose(page, "T")
    slices.first.hover()
    expect(page.locator(".slice .probe").first).to_contain_text(re.compile(r"°C, ± 0\.196 \(95 %\)"))
    page.get_by_role("checkbox", name="°C").uncheck()
    # Also what was pointed at before is in kelvin now.
    expect(page.locator(".slice .probe").first).to_contain_text(re.compile(r"\d K, ± 0\.196 \(95 %\)"))
    expect(page.locator(".slices, .room3d, .bar").filter(has_text="°C")).to_have_count(0)
    slices.nth(1).hover()
    expect(page.locator(".slice .probe").nth(1)).to_contain_text(re.compile(r"\d K, ±"))
    expect(page.locator(".bar").first).to_contain_text("they have the end's colour")
    page.get_by_label("Leave out extremes").uncheck()
    expect(page.locator(".bar").first).not_to_contain_text("they have the end's colour")
    page.get_by_role("button", name="Its uncertainty").click()
    expect(page.locator(".bar").first).to_contain_text("Temperature: standard deviation")
    page.get_by_role("button", name="Back to temperature").click()

    choose(page, "20260101T000000-standard", "Compare with")
    expect(page.locator("main")).to_contain_text("solve: rounds")
    expect(slices).to_have_count(9)
    expect(slices.nth(8)).to_have_attribute("data-painted", PAINTED)
    expect(page.locator(".chart canvas")).to_be_visible()
    # The two differ by 0.2 K everywhere: the colour of the difference is one colour.
    slices.nth(6).hover()
    expect(page.locator(".slice").nth(6)).to_contain_text("0.200 K")
    snapshot(page, "look-two-results")
    choose(page, "", "Compare with")

    look_round(page)
    keep_files(page)
    assert watched.complaints == []


def test_an_object_is_grey_and_a_plane_is_dragged_by_its_grip(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
    experiment = station.app.state.services.folders.open(name)
    keep(experiment, "20260101T000000-standard", room(), "standard", 1.0, (DESK,))
    watched = opens(station.address)
    page = watched.page
    expect(page.locator(".bar").first).to_contain_text("grey: people and furniture")
    slices = page.locator(".slice canvas")
    expect(slices.first).to_have_attribute("data-painted", PAINTED)
    # The middle of the desk in the plane across y, and air above it.
    colours = slices.first.evaluate(
        """canvas => [0.9, 0.4].map(down => [...canvas.getContext("2d").getImageData(
             canvas.width * 0.5, canvas.height * down, 1, 1).data].slice(0, 3))"""
    )
    assert colours[0] == [128, 130, 134], colours
    assert colours[1] != colours[0]
    # Nothing moves the slices any more.
    expect(page.locator(".volume > div")).to_have_attribute("data-frame-ms", PAINTED)
    box = slices.first.bounding_box()
    slices.first.hover(position={"x": 0.5 * box["width"], "y": 0.9 * box["height"]})
    expect(page.locator(".slice .probe").first).to_contain_text("an object, no air")

    grip = page.locator(".grip[title='Drag the plane along y']")
    slider = page.get_by_label("Plane at y")
    expect(slider.first).to_have_value("50")
    page.evaluate("scrollTo(0, 0)")
    held = grip.bounding_box()
    page.mouse.move(held["x"] + 8, held["y"] + 8)
    page.mouse.down()
    page.mouse.move(held["x"] + 68, held["y"] - 12, steps=3)
    page.mouse.up()
    expect(slider.first).not_to_have_value("50")
    moved = grip.bounding_box()
    assert moved["x"] > held["x"] + 20
    page.get_by_role("checkbox", name="Plane across z").check()
    expect(page.locator(".grip:not([hidden])")).to_have_count(2)
    snapshot(page, "look-desk")
    assert watched.complaints == []


def test_what_was_found_goes_to_the_rooms_editor_by_one_click(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        answers = next(one.answers for one in client.templates() if one.template == "sample")
        name = client.create_from_answers(answers).experiment
        without = client.create_experiment(camera_px=64).experiment
    folders = station.app.state.services.folders
    box = RoomObject(name="found 1", lower_m=(0.5, -0.5, 0.0), upper_m=(0.9, -0.1, 1.2))
    sentence = "Something that the scene does not state hides 3.0 % of the wall."
    thing = Found(0, 0.03, (0.4, 1.0), (0.0, 1.2), (10.0, 20.0, 30.0, 40.0), "seen", box, True, sentence)
    second = dataclasses.replace(thing, box=dataclasses.replace(box, name="found 2"), sentence="Another one.")
    for one, things in ((without, (thing,)), (name, (thing, second))):
        experiment = folders.open(one)
        keep(experiment, "20260101T000000-standard", room(), "standard", 1.0)
        folder = experiment.results_folder / "20260101T000000-standard"
        write_manifest(folder, read_manifest(folder) | {"found": to_plain(things)})
    watched = opens(f"{station.address}")
    page = watched.page
    page.get_by_label("Experiment").select_option(name)
    page.get_by_role("button", name="Look", exact=True).click()
    # Several are told in one line, so that the room comes first.
    expect(page.get_by_text(sentence)).to_be_hidden()
    page.get_by_text("2 things stand before the wall that the scene does not state").click()
    expect(page.get_by_text(sentence)).to_be_visible()
    snapshot(page, "look-found")
    page.get_by_role("button", name="Add what stands here: found 1").click()
    group = page.get_by_role("group", name="object 1")
    expect(group.get_by_label("Size along z")).to_have_value("1.2 m")
    page.locator("button.next", has_text="Change the room").click()
    expect(page.locator("main")).to_contain_text("made with another room")
    (stated,) = folders.open(name).settings.scene.objects
    assert stated.lower_m == pytest.approx(box.lower_m)
    # Once more the editor opens with what is there, and nothing besides.
    page.get_by_role("button", name="Rig", exact=True).click()
    page.get_by_role("button", name="Edit room").click()
    expect(page.get_by_role("group", name="object 1")).to_be_visible()
    expect(page.get_by_role("group", name="object 2")).to_have_count(0)

    page.get_by_role("button", name="Look", exact=True).click()
    # A room that was not entered on the page takes it as well.
    page.get_by_label("Experiment").select_option(without)
    page.get_by_role("button", name="Add what stands here: found 1").click()
    expect(page.get_by_role("group", name="object 1").get_by_label("Size along z")).to_have_value("1.2 m")
    assert watched.complaints == []


def test_why_a_result_is_not_to_be_believed_stands_above_its_picture(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
    experiment = station.app.state.services.folders.open(name)
    (wrong,) = doubtful(0.57)
    for result, notes in (("20260101T000000-standard", []), ("20260101T000030-standard", [wrong])):
        keep(experiment, result, room(), "standard", 1.0)
        folder = experiment.results_folder / result
        write_manifest(
            folder,
            read_manifest(folder)
            | {"assumed": notes, "created": f"2026-01-01T00:00:{'30' if notes else '00'}+00:00"},
        )
    page = opens(station.address).page
    page.get_by_role("button", name="Look", exact=True).click()
    told = page.get_by_role("note")
    expect(told).to_have_text(re.compile(r"Before you believe this: .*wrong by 57 % .*distrust the velocity"))
    assert told.bounding_box()["y"] < page.locator(".volume").bounding_box()["y"]
    snapshot(page, "look-doubt")
    # Two of one minute have names of their own.
    names = page.locator(".picked select").first.locator("option").all_inner_texts()
    assert len({one.split(", ±")[0] for one in names}) == 2
    choose(page, "20260101T000000-standard", "Result")
    expect(told).to_have_count(0)


def test_a_sequence_is_looked_at_moment_by_moment(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
    mean = room()
    x, y, z = np.meshgrid(mean.x_m, mean.y_m, mean.z_m, indexing="ij")
    places_m = np.linspace(mean.x_m[4], mean.x_m[-5], 4)
    puffs_k = [2.0 * np.exp(-((x - at) ** 2 + y**2 + (z - 1.0) ** 2) / 0.1) for at in places_m]
    bursts = Departures(
        time_s=6.0 * np.arange(4),
        temperature_k=np.stack(puffs_k).astype(np.float32),
        temperature_std_k=np.full(x.shape, 0.1, np.float32),
        field_std_k=0.2,
        field_length_m=0.3,
    )
    moving = dataclasses.replace(mean, departures=bursts)
    keep(station.app.state.services.folders.open(name), "20260101T000000-standard", moving, "standard", 1.0)
    watched = opens(station.address)
    page = watched.page
    page.get_by_role("button", name="Look", exact=True).click()
    expect(page.locator("main")).to_contain_text("This result is the mean of 4 bursts.")
    slices = page.locator(".slice canvas")
    expect(slices.first).to_have_attribute("data-painted", PAINTED)
    page.get_by_role("button", name="Difference to the mean").click()
    moment = page.get_by_role("slider", name="Moment")
    expect(moment).to_have_value("0")
    expect(page.locator("main")).to_contain_text("0 s of 18 s")
    # The puff stands further along x in each burst: no two pictures are alike.
    pictures = {slices.first.screenshot()}
    for burst in (1, 2, 3):
        moment.fill(str(burst))
        expect(moment).to_have_attribute("aria-valuetext", f"{6 * burst} s")
        pictures.add(another(slices.first, pictures))
    assert len(pictures) == 4
    snapshot(page, "look-sequence")
    page.get_by_role("button", name="The temperature itself").click()
    page.get_by_role("button", name="Play").click()
    expect(moment).not_to_have_value("3")
    page.get_by_role("button", name="Pause").click()
    assert watched.complaints == []


def test_streamlines_move_where_motion_is_wanted(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
    keep(station.app.state.services.folders.open(name), "20260101T000000-standard", room(), "standard", 1.0)
    page = opens(station.address, reduced_motion="reduce").page
    page.get_by_role("button", name="Look", exact=True).click()
    place = page.locator(".volume > div")
    expect(place).to_have_attribute("data-frame-ms", PAINTED)
    expect(place).not_to_have_attribute("data-moved", PAINTED)
    page.get_by_label("Moving").check()
    expect(place).to_have_attribute("data-moved", re.compile(r"\d\d"))
    page.get_by_label("Moving").uncheck()


def test_pointing_a_link_and_a_film(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
    keep(station.app.state.services.folders.open(name), "20260101T000000-standard", room(), "standard", 1.0)
    watched = opens(station.address)
    page = watched.page
    # What there is to see is seen first.
    expect(page.locator("main")).to_have_attribute("aria-label", "Look")
    place = page.locator(".volume")
    expect(place.locator("[data-frame-ms]")).to_be_attached()
    box = place.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    expect(place.locator(".over")).to_contain_text(re.compile(r"°C, ± 0\.196 \(95 %\); speed \d"))
    expect(place).to_contain_text("camera, 4.0 m from the wall")
    usual = place.screenshot()
    page.get_by_label("Streamlines").uncheck()
    page.get_by_role("button", name="Side", exact=True).click()
    choose(page, "speed")
    turned = another(place, {usual})
    page.get_by_role("button", name="Link", exact=True).click()
    expect(page.locator("footer")).to_contain_text("link to this view", ignore_case=True)
    link = page.url
    page.goto("about:blank")
    page.goto(link)
    expect(page.locator(".bar").first).to_contain_text("Speed")
    expect(page.get_by_label("Streamlines")).not_to_be_checked()
    assert another(place, {usual}) != usual
    assert turned
    with page.expect_download() as download:
        page.get_by_role("button", name="Film", exact=True).click()
    # WebM is Matroska: EBML's first bytes.
    assert Path(download.value.path()).read_bytes().startswith(b"\x1a\x45\xdf\xa3")
    assert watched.complaints == []


def test_profiles_over_the_height_stand_beside_the_truth_and_the_sensors(station: Station, opens: Opens):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
    experiment = station.app.state.services.folders.open(name)
    found = room()
    keep(experiment, "20260101T000000-standard", found, "standard", 1.0)
    watched = opens(station.address)
    page = watched.page
    page.get_by_role("button", name="Look", exact=True).click()
    pole = page.locator(".profiles figure")
    expect(pole).to_have_count(3)
    expect(pole.locator("path.truth")).to_have_count(3)
    # JavaScript rounds halves upwards.
    i, j = (int(share * (len(x) - 1) + 0.5) for share, x in ((0.25, found.x_m), (0.5, found.y_m)))
    floor_c = float(found.temperature_k[i, j, 1]) - 273.15
    said = pole.first.locator("svg").get_attribute("aria-label")
    expect(pole.first.locator("path.found")).to_be_visible()
    assert f"{floor_c:.2f} °C at the floor" in str(said)

    readings = "x,y,z,T,T_std\n0.5,0,0.5,296.5,0.1\n0.5,0,1.5,299.5,0.1\n"
    write_text(experiment.folder / "sensors.csv", readings)
    scene = experiment.settings.scene
    known = (*scene.boundary, PointSensors(file="sensors.csv"))
    stated = experiment.settings.model_copy(update={"scene": dataclasses.replace(scene, boundary=known)})
    save_settings(experiment.folder, stated)
    page.reload()
    page.get_by_role("button", name="Look", exact=True).click()
    expect(pole).to_have_count(1)
    expect(pole.locator("circle.sensor")).to_have_count(2)
    snapshot(page, "look-profiles")
    assert watched.complaints == []


BOXES = """words => words.filter(e => !e.hidden).map(e => {
  const { left, top, right, bottom } = e.getBoundingClientRect();
  return [e.textContent.trim(), left, top, right, bottom];
})"""
Word = tuple[str, float, float, float, float]


def are_apart(words: list[Word], frame: Locator) -> None:
    """No word lies on another one, and none leaves its picture."""
    box = frame.bounding_box()
    assert box is not None
    for n, (text, left, top, right, bottom) in enumerate(words):
        assert box["x"] <= left + 0.5, text
        assert right - 0.5 <= box["x"] + box["width"], text
        assert box["y"] <= top + 0.5, text
        assert bottom - 0.5 <= box["y"] + box["height"], text
        for other, x0, y0, x1, y1 in words[n + 1 :]:
            assert min(right, x1) - max(left, x0) < 1 or min(bottom, y1) - max(top, y0) < 1, (text, other)


@pytest.mark.parametrize("wide_px", [390, 1440])
def test_words_in_the_room_stay_in_the_picture_and_off_one_another(
    station: Station, opens: Opens, wide_px: int
):
    with Client(f"http://127.0.0.1:{station.port}", station.token, timeout_s=200) as client:
        name = client.create_experiment(camera_px=64).experiment
    experiment = station.app.state.services.folders.open(name)
    # Two names of one place, and the camera's at the edge of a narrow picture.
    behind = dataclasses.replace(DESK, name="another desk")
    keep(experiment, "20260101T000000-standard", room(), "standard", 1.0, (DESK, behind))
    watched = opens(station.address, viewport={"width": wide_px, "height": 844})
    page = watched.page
    page.get_by_role("button", name="Look", exact=True).click()
    place = page.locator(".volume")
    expect(place.locator("[data-frame-ms]")).to_be_attached()
    for view in ("Corner", "Front", "Side", "Top"):
        page.get_by_role("button", name=view, exact=True).click()
        words = page.locator(".volume .mark").evaluate_all(BOXES)
        are_apart(words, place)
        shown = {one[0] for one in words}
        assert {"supply", DESK.name, "another desk"} <= shown, view
        assert view != "Corner" or {"x [m]", "y [m]", "z [m]"} <= shown
    assert watched.complaints == []
