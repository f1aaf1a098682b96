"""One road from captures to report: what it keeps is what it used, and nothing after the solve can cost it."""

import json
import resource
import shutil
from collections.abc import Mapping

import numpy as np
import pytest

from app.experiment.folder import open_experiment, read_manifest
from app.experiment.results import read_result
from app.files.provenance import sha256
from app.pipeline import reconstruct
from app.report.page import report_again
from core.watch import Watch


@pytest.fixture(scope="module")
def disturbed(experiment, tmp_path_factory):
    """A draft during which another flow was finished, and whose report could not be written."""
    copy = tmp_path_factory.mktemp("disturbed") / "room"
    shutil.copytree(experiment, copy)
    shutil.rmtree(copy / "results", ignore_errors=True)
    used = open_experiment(copy).latest_capture("flow")
    into = copy / "results" / "in-place"
    # A page cannot be put in the place of a folder that holds something: any OSError ends the same way.
    (into / "report.html" / "in the way").mkdir(parents=True)

    def another_capture(row: Mapping[str, float | str], growing: object) -> None:
        if str(row["doing"]).startswith("solve ("):
            later = copy / "captures" / "29990101T000000-flow"
            shutil.copytree(used, later)
            manifest = json.loads((later / "manifest.json").read_text()) | {
                "created": "2999-01-01T00:00:00+00:00"
            }
            (later / "manifest.json").write_text(json.dumps(manifest))

    return used, reconstruct(copy, "draft", watch=Watch(another_capture), into=into)


def test_a_capture_finished_meanwhile_is_not_the_one_that_was_used(disturbed):
    used, done = disturbed
    manifest = read_manifest(done.folder)
    assert open_experiment(done.folder.parents[1]).latest_capture("flow") != used
    assert manifest["captures"]["flow"] == used.name
    assert manifest["inputs"]["flow/manifest.json"]["sha256"] == sha256(used / "manifest.json")
    assert manifest["inputs"]["flow/flow.tif"] == {
        "capture": used.name, "file": "flow.tif", "sha256": sha256(used / "flow.tif"),
    }  # fmt: skip
    # Nor is the calibration's age that of a capture of the year 2999.
    assert not any("The flow capture" in sentence for sentence in manifest["assumed"])


def test_a_report_that_cannot_be_written_leaves_the_result_and_says_why(disturbed, done):
    _, kept = disturbed
    assert "its report could not be written" in kept.no_report
    assert "irectory" in kept.no_report
    found = read_result(kept.folder / "result.nc")
    np.testing.assert_array_equal(found.temperature_k, done.solution.temperature_k.astype(np.float32))
    (kept.folder / "report.html" / "in the way").rmdir()
    (kept.folder / "report.html").rmdir()
    page = report_again(kept.folder.parents[1], kept.folder).read_text()
    assert page.count("data:image/png") == (done.folder / "report.html").read_text().count("data:image/png")


@pytest.fixture(scope="module")
def broken(experiment, tmp_path_factory):
    """A draft at whose report the guide is half finished, the bundle broken, the truth gone and the disk full."""
    copy = tmp_path_factory.mktemp("broken") / "room"
    shutil.copytree(experiment, copy)
    shutil.rmtree(copy / "results", ignore_errors=True)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    def break_all(row: Mapping[str, float | str], growing: object) -> None:
        if row["doing"] == "report":
            (copy / "calibration" / "record-camera.json").write_text('{"camera": "camera"')
            (copy / "calibration" / "bundle.json").write_text("{")
            (copy / "truth.npz").unlink()
            resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))

    try:
        return reconstruct(copy, "draft", watch=Watch(break_all))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_whatever_is_broken_at_the_report_the_result_is_there(broken, done):
    assert "its report could not be written" in broken.no_report
    assert "File too large" in broken.no_report
    found = read_result(broken.folder / "result.nc")
    np.testing.assert_array_equal(found.temperature_k, done.solution.temperature_k.astype(np.float32))
    page = report_again(broken.folder.parents[1], broken.folder).read_text()
    assert "There is no truth" in page
    # Every picture but those that need the truth or the bundle.
    assert page.count("data:image/png") >= 5


def test_what_nothing_uses_is_not_told(done):
    assert done.problem.scene.flow.transport == "auto"
    assert "choices" not in read_manifest(done.folder)
