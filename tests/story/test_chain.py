"""The whole chain on the packaged room with a small, noise-free camera: simulate to report and export."""

import json
import shutil
import subprocess
import sys
from html import unescape

import numpy as np
import pytest
import xarray as xr
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLImageDataReader

from app.errors import BadInputError
from app.experiment.folder import interrupted, open_experiment, read_manifest
from app.experiment.plan import read_plan
from app.files.provenance import sha256
from app.pipeline import reconstruct
from app.plan.make import plan
from app.reconstruct.presets import PRESETS
from app.report.export import export
from app.simulate.experiment import simulate
from app.volume.score import score_experiment
from core.displacement import standard_deviation_px
from core.motion import motion_basis
from tests.rooms import ROOM


def test_the_temperature_beats_the_inlet_plane_carried_through_the_room(done, experiment):
    scores = score_experiment(experiment, ROOM)
    # 8 px windows of a noise-free 512 px camera: the images fix the mean along the view.
    assert scores["T"]["rms_K"] < scores["T"]["trivial"]["inlet_plane"]
    assert scores["u"] is None
    assert {"rms_K", "rel_departure", "trivial"} <= scores["T"].keys()
    assert scores["solver_s"] > 0
    assert scores["wall_s"] >= scores["solver_s"]


def test_the_truth_does_not_leak_into_the_reconstruction(done, experiment, tmp_path):
    copy = tmp_path / "blind"
    shutil.copytree(experiment, copy)
    (copy / "truth.npz").unlink()
    blind = reconstruct(copy, "draft")
    np.testing.assert_array_equal(blind.solution.temperature_k, done.solution.temperature_k)
    assert "There is no truth" in (blind.folder / "report.html").read_text()


def test_the_drift_between_the_exposures_is_found(done):
    drift_px, camera = done.measurement.drifts_px[0], done.problem.scene.views[0].camera
    middle = (np.array([[camera.width_px, camera.height_px]]) - 1.0) / 2.0
    size = float(np.linalg.norm(motion_basis(middle, camera)[0] @ drift_px))
    # 0.02 px were applied; aliasing leaves a few thousandths of it.
    assert size == pytest.approx(0.02, rel=0.05)


def test_a_plan_says_what_the_reconstruction_then_finds(done, experiment):
    made = plan(experiment)
    view, shift = made.views[0], done.problem.shifts[0]
    measured = float(np.sqrt(np.mean(np.median(standard_deviation_px(shift), axis=0) ** 2)))
    assert view.noise_px == pytest.approx(measured, rel=0.2)
    sizes = np.linalg.norm(shift.displacement_px, axis=1)
    assert 0.4 < view.shift_p90_px / np.percentile(sizes, 90) < 2.5
    assert read_plan(open_experiment(experiment)) == made
    assert {line.preset for line in made.presets} == set(PRESETS)


def test_the_result_is_readable_by_others_with_cf_names_and_units(done):
    with xr.open_dataset(done.folder / "result.nc", engine="h5netcdf") as data:
        assert data["T"].attrs["standard_name"] == "air_temperature"
        assert data["T"].attrs["units"] == "K"
        assert data["x"].attrs["units"] == "m"
        assert data.attrs["Conventions"].startswith("CF")
        np.testing.assert_allclose(data["T"].to_numpy(), done.solution.temperature_k, rtol=1e-6)


def test_the_volume_opens_in_vtk_with_equal_values(done, experiment, tmp_path):
    path = export(experiment, "vti", tmp_path / "air.vti")
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    shape = done.solution.temperature_k.shape
    assert image.GetDimensions() == shape
    values = vtk_to_numpy(image.GetPointData().GetArray("T")).reshape(shape, order="F")
    np.testing.assert_array_equal(values, done.solution.temperature_k.astype(np.float32))
    assert image.GetOrigin() == pytest.approx((-1.2, -1.5, 0.0), abs=1e-6)


def test_the_csv_has_a_row_a_vertex_with_units_in_its_header(done, experiment, tmp_path):
    lines = export(experiment, "csv", tmp_path / "air.csv").read_text().splitlines()
    assert lines[0] == "x [m],y [m],z [m],T [K],T_std [K]"
    assert len(lines) == done.solution.temperature_k.size + 1
    first = done.solution.temperature_k[0, 0, 0]
    assert float(lines[1].split(",")[3]) == pytest.approx(first, rel=1e-6)


def test_the_report_is_one_offline_file_with_every_picture(done):
    page = (done.folder / "report.html").read_text()
    pictures = (
        "The room: the air's temperature",
        "Temperature on the middle planes",
        "Temperature: half of its 95 % interval",
        "Temperature minus truth",
        "mean images",
        ": measured shift, windows of",
    )
    text = unescape(page)
    assert [words for words in pictures if words not in text] == []
    assert page.count("data:image/png;base64,") == len(pictures)
    assert "http://" not in page
    assert "https://" not in page
    for words in ("What the camera saw", "Against the truth", "What was assumed", "sha256"):
        assert words in page


def test_the_manifest_says_what_the_result_came_from(done, experiment):
    manifest = read_manifest(done.folder)
    for role in ("reference", "flow"):
        capture = experiment / "captures" / manifest["captures"][role]
        for name in ("manifest.json", f"{role}.tif"):
            assert manifest["inputs"][f"{role}/{name}"]["sha256"] == sha256(capture / name)
    assert manifest["versions"]["jax"]
    assert manifest["settings"]["scene"]["room"]["upper_m"] == [2.9, 1.5, 3.0]
    assert open_experiment(experiment).latest_result() == done.folder


def test_a_result_folder_without_manifest_is_interrupted_and_never_used(done, experiment, tmp_path):
    copy = tmp_path / "cut"
    shutil.copytree(experiment, copy)
    for manifest in copy.glob("results/*/manifest.json"):
        manifest.unlink()
    assert len(interrupted(copy / "results")) >= 1
    with pytest.raises(BadInputError, match="no finished result"):
        open_experiment(copy).latest_result()


def test_an_experiment_is_not_overwritten(experiment):
    from app.experiment.rig_settings import SimulatedCameraSettings
    from app.volume.scene import RigOptions

    with pytest.raises(BadInputError, match="not empty"):
        simulate(ROOM, experiment, RigOptions(), "paper", SimulatedCameraSettings())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["reconstruct", "nowhere"], "There is no nowhere/experiment.toml"),
        (["simulate", "--truth", "none.npz", "new"], "There is no volume none.npz"),
        (["displacement", "a.png", "b.png"], "There is no picture a.png"),
        (["simulate", "--truth", str(ROOM), "--stand-off", "0", "new"], "stand-off"),
        (["simulate", "--truth", str(ROOM), "--camera-px", "4096*3", "new"], "WIDTHxHEIGHT"),
        (["reconstruct", "nowhere", "--colour"], "No such option"),
    ],
)
def test_bad_input_ends_in_one_sentence_and_status_2(arguments, words, tmp_path):
    ran = subprocess.run(
        [sys.executable, "-m", "app.cli", *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 2
    assert words in ran.stderr
    assert "Traceback" not in ran.stderr
    assert not (tmp_path / "new").exists()


def test_score_prints_json_with_the_stated_keys(done, experiment):
    command = ["score", str(experiment), "--truth", str(ROOM), "--json"]
    ran = subprocess.run(
        [sys.executable, "-m", "app.cli", *command], capture_output=True, text=True, check=True
    )
    scores = json.loads(ran.stdout)
    assert set(scores["T"]["trivial"]) == {"ambient", "inlet_plane", "y_mean"}
