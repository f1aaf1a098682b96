"""A result is worth more than its report: what cannot be drawn says why in its place, and the rest is there."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from app.errors import BadInputError
from app.experiment.captures import newest_pair, write_capture
from app.experiment.folder import ExperimentSettings, create_experiment, write_manifest
from app.experiment.found import Found
from app.experiment.results import write_result
from app.experiment.rig_settings import RigSettings, SimulatedCameraSettings
from app.experiment.shift_files import write_shifts
from app.files.provenance import provenance
from app.files.toml import to_plain
from app.report.answer import summary
from app.report.export import export
from app.report.finding import Finding, read_finding
from app.report.indoor import indoor_of
from app.report.page import render_report, report_again, write_report
from app.report.pdf import write_pdf
from calibration.record import Record, SeenBoard, record_to_json
from core.geometry import Box, looking_along_y
from core.objects import RoomObject
from core.problem import ShiftMeasurement
from core.result import Solution
from core.scene import FixedTexture, Inlet, Patch, Scene, View
from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern

ROOM = Box(lower_m=(-1.0, -1.0, -1.0), upper_m=(1.0, 1.0, 1.0))
SUPPLY = Patch(wall="x_min", lower_m=(-0.5, 0.0), upper_m=(0.5, 0.5))
INLET = Inlet(patch=SUPPLY, temperature_k=300.0, velocity_m_s=(0.5, 0.0, 0.0))
HEADINGS = ("What the camera saw", "How far the pattern moved", "The air", "What was assumed")


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """An experiment with its captures and one result on disk."""
    camera = looking_along_y(position_m=(0.0, -3.0, 0.0), width_px=128, height_px=96, focal_px=200.0)
    scene = Scene(room=ROOM, views=(View(camera=camera),), light=FixedTexture(), boundary=(INLET,))
    settings = ExperimentSettings(rig=RigSettings(camera=SimulatedCameraSettings()), scene=scene)
    experiment = create_experiment(tmp_path_factory.mktemp("kept") / "experiment", settings)
    for role in ("reference", "flow"):
        burst = run_capture(SimulatedCamera(pattern, seed=1), CapturePlan(role=role, frames=2))
        write_capture(experiment.captures_folder / f"1-{role}", burst)
    captures = newest_pair(experiment)
    axis = np.linspace(-1.0, 1.0, 5)
    temperature_k = 293.0 + np.add.outer(np.add.outer(axis, axis), axis)
    solution = Solution(axis, axis, axis, temperature_k, notes=("solved",))
    centres_px = np.array([[8.0, 8.0], [24.0, 8.0], [8.0, 24.0], [24.0, 24.0]])
    shift = ShiftMeasurement(centres_px, 0.01 * centres_px, np.tile(np.eye(2), (4, 1, 1)), 16)
    manifest = {
        "preset": "draft", "outcome": "converged", "advice": "", "solver_s": 1.0, "wall_s": 2.0,
        "assumed": ["nothing"], "inputs": captures.inputs,
        "captures": {"reference": captures.reference.folder.name, "flow": captures.flow.folder.name},
        **provenance(),
    }  # fmt: skip
    folder = experiment.results_folder / "one"
    folder.mkdir(parents=True)
    write_result(folder / "result.nc", solution, {})
    write_shifts(folder, (shift,))
    write_manifest(folder, manifest)
    return Finding(experiment, "one", manifest, solution, lambda: (shift,), lambda: captures)


def missing(page):
    return re.findall(r'<p class="missing">(.*?)</p>', page)


def test_a_report_from_memory_is_the_report_from_the_disk(kept):
    page = render_report(kept)
    assert render_report(read_finding(kept.experiment, kept.experiment.results_folder / "one")) == page
    assert missing(page) == []
    assert all(heading in page for heading in HEADINGS)
    assert "There is no truth" in page
    for entry in kept.manifest["inputs"].values():
        assert entry["sha256"] in page


def test_an_object_leaves_the_air_around_it_its_numbers(kept):
    table = RoomObject(name="table", lower_m=(-0.7, -0.7, -1.0), upper_m=(-0.3, -0.3, 0.2))
    still = np.zeros((5, 5, 5, 3), np.float32)
    solution = replace(
        kept.solution,
        temperature_std_k=np.full((5, 5, 5), 0.1),
        velocity_m_s=still + 0.1,
        velocity_std_m_s=still + 0.01,
    )
    finding = replace(kept, solution=solution.without_objects((table,)))
    assert "temperature to ± 0.20 K and velocity to ± 0.03 m/s (95 %)" in " ".join(summary(finding))
    page = render_report(finding)
    assert missing(page) == []
    assert "nan" not in re.sub(r"base64,[^\"]*", "", page)
    write_pdf(finding, kept.experiment.folder / "report.pdf")


def test_what_is_no_result_is_named_with_those_that_are(kept):
    folder, results = kept.experiment.folder, kept.experiment.results_folder
    for given in (results, folder / "nix"):
        for use in (report_again, indoor_of, lambda at, result: export(at, "csv", None, result)):
            with pytest.raises(
                BadInputError, match=rf"{given} is no result\. Results of .*: {results / 'one'}\."
            ):
                use(folder, given)


def test_an_export_has_the_format_that_its_name_ends_in(kept):
    folder = kept.experiment.folder
    table = export(folder, output=folder / "air.csv")
    assert table.read_text().startswith("x [m],y [m],z [m],T [K]")
    assert export(folder).name == "result-export.nc"
    for kind, name in ((None, "air.xls"), (None, "air"), ("nc", "air.csv")):
        with pytest.raises(BadInputError, match="expected a name that ends in"):
            export(folder, kind, folder / name)


def test_a_guide_left_half_way_costs_the_report_nothing(kept):
    record = kept.experiment.folder / "calibration" / "record-camera.json"
    record.parent.mkdir()
    points = tuple((0.1 * i, 0.1 * j, 0.0) for i in range(4) for j in range(3))
    boards = tuple(
        SeenBoard(name, name, points, tuple((10.0 * i, 10.0 * j) for i in range(4) for j in range(3)))
        for name in ("one", "two")
    )
    record.write_text(record_to_json(Record("camera", (128, 96), boards=boards)))
    page = render_report(kept)
    record.unlink()
    assert missing(page) == []
    assert all(heading in page for heading in HEADINGS)


def test_a_truth_that_cannot_be_read_costs_the_comparison_only(kept):
    truth = kept.experiment.folder / "truth.npz"
    truth.write_text("no volume")
    page = render_report(read_finding(kept.experiment, kept.experiment.results_folder / "one"))
    truth.unlink()
    assert len(missing(page)) == 2
    assert all("truth.npz cannot be read" in why for why in missing(page))
    assert page.count("data:image/png") == render_report(kept).count("data:image/png")


def test_a_picture_and_a_shift_that_cannot_be_read_cost_their_own_sections_only(kept):
    folder = kept.experiment.results_folder / "one"
    picture = kept.experiment.captures_folder / kept.manifest["captures"]["flow"] / "flow.tif"
    content, shift = picture.read_bytes(), (folder / "shift-0.nc").read_bytes()
    picture.write_bytes(content[:-1])
    (folder / "shift-0.nc").write_bytes(b"")
    page = render_report(read_finding(kept.experiment, folder))
    picture.write_bytes(content)
    (folder / "shift-0.nc").write_bytes(shift)
    saw, moved = missing(page)
    assert "flow.tif is not the file that was kept" in saw
    assert "shift-0.nc cannot be read" in moved
    # The room and the planes of its air are drawn.
    assert page.count("data:image/png") == 2


def test_what_was_found_before_the_wall_is_drawn_and_told(kept):
    box = RoomObject(name="found 1", lower_m=(0.0, 0.2, -1.0), upper_m=(0.4, 0.6, 0.1))
    thing = Found(
        0, 0.1, (0.0, 0.5), (-1.0, 0.1), (64.0, 40.0, 88.0, 90.0), "seen", box, True, "It stands there."
    )
    told = replace(
        kept,
        manifest={
            **kept.manifest,
            "found": to_plain((thing,)),
            "assumed": [*kept.manifest["assumed"], "It stands there."],
        },
    )
    page = render_report(told)
    assert missing(page) == []
    assert "found 1: It stands there." in page
    assert page.count("data:image/png") == render_report(kept).count("data:image/png") + 1
    # It is told once; what to do about it stands with the other advice.
    assert page.count("It stands there.") == 1
    assert "<li>Something that the scene does not state hides 10.0 % of the wall" in page


def test_a_result_of_an_older_program_is_reported_with_what_it_has(kept):
    folder = kept.experiment.results_folder / "one"
    manifest = json.loads((folder / "manifest.json").read_text())
    old = manifest | {"choices": [], "inputs": {"flow_manifest": {"file": "manifest.json", "sha256": "ab12"}}}
    (folder / "manifest.json").write_text(json.dumps(old))
    page = write_report(read_finding(kept.experiment, folder), folder).read_text()
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert "manifest.json, sha256 ab12" in page
    assert missing(page) == []
