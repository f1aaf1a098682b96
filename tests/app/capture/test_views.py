"""An experiment with two views: simulated, captured in turn, and reconstructed by every door's own function."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.capture.burst import take
from app.capture.watched import BurstWatch
from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.captures import load_capture, newest_pair
from app.experiment.folder import open_experiment
from app.experiment.rig_settings import V4l2CameraSettings
from app.files.provenance import sha256
from app.pipeline import reconstruct
from app.rig.open import air_of, named_camera, open_camera
from drivers.burst import CapturePlan
from tests.rooms import ROOM, state_grid


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("views") / "room"
    options = [
        "--information",
        "surveyed",
        "--camera-px",
        "160",
        "--frames",
        "2",
        "--views",
        "y,x",
        "--world",
        "ideal",
    ]
    done = CliRunner().invoke(
        create_cli(), ["simulate", str(folder), "--truth", str(ROOM), *options], catch_exceptions=False
    )
    assert done.exit_code == 0, done.output
    return state_grid(folder, 8)


def test_a_capture_holds_a_picture_of_every_view(folder):
    experiment = open_experiment(folder)
    assert [view.wall for view in experiment.settings.scene.views] == ["y_max", "x_max"]
    capture = newest_pair(experiment).flow
    assert capture.complete
    assert [one["file"] for one in capture.manifest["views"]] == ["flow.tif", "flow-1.tif"]
    first, second = (image.mean for image in capture.images)
    assert first.shape == second.shape
    # Another wall, another print, other noise.
    assert abs(float(np.corrcoef(first.ravel(), second.ravel())[0, 1])) < 0.9
    assert capture.manifest["views"][1]["camera"]["name"] == "simulated camera at x_max"


def test_both_views_are_measured_and_the_room_is_found(folder):
    done = reconstruct(folder, "draft")
    assert [shift is not None for shift in done.problem.shifts] == [True, True]
    assert len(done.finding.manifest["windows"]) == 2
    assert {"shift-0.nc", "shift-1.nc"} <= {path.name for path in done.folder.iterdir()}
    assert "camera at x_max" in (done.folder / "report.html").read_text()
    assert np.isfinite(done.solution.temperature_k).all()


def without_the_second(monkeypatch):
    """The second camera does not answer."""

    def broken(experiment, air, view=0, moment=None):
        if view == 1:
            raise BadInputError("The second camera does not answer.")
        return open_camera(experiment, air, view, moment)

    monkeypatch.setattr("app.capture.views.open_camera", broken)


def run(*arguments):
    return CliRunner().invoke(create_cli(), [str(one) for one in arguments])


def test_a_camera_that_fails_in_its_turn_leaves_no_measurement_and_is_taken_alone(folder, monkeypatch):
    experiment = open_experiment(folder)
    before = experiment.latest_capture("reference")
    with monkeypatch.context() as patch, open_camera(experiment, "still") as camera:
        without_the_second(patch)
        taken = take(camera, experiment, CapturePlan(frames=3))
    assert "lacks the pictures of 'camera at x_max'" in taken.shortfall
    assert "does not answer" in taken.shortfall
    assert "airlens capture retake" in taken.shortfall
    assert experiment.latest_capture("reference") == before
    kept = taken.folder
    assert kept is not None
    assert [path.name for path in sorted(kept.glob("*.*"))] == [
        "incomplete.json",
        "part-0.json",
        "reference.tif",
    ]

    # The one that is missing, alone; the other camera's picture is the one that was kept.
    whole = sha256(kept / "reference.tif")
    done = run("capture", "retake", folder)
    assert done.exit_code == 0, done.output
    assert experiment.latest_capture("reference") == kept
    capture = load_capture(kept)
    assert capture.complete
    assert [image.frames for image in capture.images] == [3, 3]
    assert [one["view"] for one in capture.manifest["views"]] == ["camera", "camera at x_max"]
    assert capture.manifest["views"][0]["sha256"] == whole
    assert not list(kept.glob("part-*"))


def test_one_camera_of_a_whole_capture_is_taken_again_into_a_new_one(folder):
    experiment = open_experiment(folder)
    with open_camera(experiment, "still") as camera:
        first = take(camera, experiment, CapturePlan(frames=2)).folder
    assert first is not None
    unnamed = run("capture", "retake", folder)
    assert "has 2 views: 'camera', 'camera at x_max'" in str(unnamed.exception)
    unknown = run("capture", "retake", folder, "--view", "left")
    assert "no view 'left'; its views are 'camera', 'camera at x_max'" in str(unknown.exception)
    before = (first / "manifest.json").read_bytes()
    assert run("capture", "retake", folder, "--view", "camera at x_max").exit_code == 0
    again = experiment.latest_capture("reference")
    assert again != first
    assert (first / "manifest.json").read_bytes() == before
    assert sha256(again / "reference.tif") == sha256(first / "reference.tif")
    assert load_capture(again).manifest["origin"]["retaken"] == {"view": "camera at x_max", "of": first.name}


def test_a_view_of_a_sequence_that_is_whole_is_not_taken_alone(folder, tmp_path):
    copy = tmp_path / "room"
    shutil.copytree(folder, copy)
    assert run("capture", "flow", copy, "--frames", 2, "--bursts", 2, "--every-s", 60).exit_code == 0
    done = run("capture", "retake", copy, "--view", "camera")
    assert "belong together" in str(done.exception)


def test_a_burst_that_is_stopped_in_the_first_view_is_no_measurement(folder):
    experiment = open_experiment(folder)
    before = experiment.latest_capture("reference")
    seen: list[object] = []
    watch = BurstWatch(seen.append, stop=lambda: "keep" if len(seen) > 1 else None)
    with open_camera(experiment, air_of("reference")) as camera:
        taken = take(camera, experiment, CapturePlan(frames=3), watch=watch)
    assert "ended early" in taken.shortfall
    assert taken.folder is not None
    assert not load_capture(taken.folder).complete
    assert experiment.latest_capture("reference") == before


def test_a_real_rig_names_the_camera_of_each_view(folder):
    experiment = open_experiment(folder)
    first = V4l2CameraSettings(
        kind="v4l2", device="/dev/video0", width_px=160, height_px=120, exposure_s=0.01
    )
    second = first.model_copy(update={"device": "/dev/video2"})
    rig = experiment.settings.rig.model_copy(update={"camera": first})
    alone = replace(experiment, settings=experiment.settings.model_copy(update={"rig": rig}))
    assert named_camera(alone) == first
    with pytest.raises(
        BadInputError, match=r'names no camera for its view .* \[rig.cameras."camera at x_max"\]'
    ):
        named_camera(alone, 1)
    both = rig.model_copy(update={"cameras": {"camera at x_max": second}})
    whole = replace(experiment, settings=experiment.settings.model_copy(update={"rig": both}))
    assert named_camera(whole, 1) == second
    assert both.addresses == ("/dev/video0", "/dev/video2")


@pytest.mark.parametrize("views", ["q", "y,y_max", "", "y,,x"])
def test_walls_that_are_none_are_refused(views, tmp_path):
    done = CliRunner().invoke(
        create_cli(), ["simulate", str(tmp_path / "room"), "--truth", str(ROOM), "--views", views]
    )
    assert done.exit_code != 0
    assert isinstance(done.exception, BadInputError)
    assert "expected" in str(done.exception)
