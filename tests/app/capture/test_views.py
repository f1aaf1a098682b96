"""An experiment with two views: simulated, captured in turn, and reconstructed by every door's own function."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.capture.burst import BurstWatch, take
from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.captures import load_capture, newest_pair
from app.experiment.folder import open_experiment
from app.experiment.rig_settings import V4l2CameraSettings
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


def test_a_camera_that_fails_in_its_turn_leaves_no_measurement(folder, monkeypatch):
    experiment = open_experiment(folder)
    before = experiment.latest_capture("reference")
    opened = open_camera

    def broken(experiment, air, view=0, moment=None):
        if view == 1:
            raise BadInputError("The second camera does not answer.")
        return opened(experiment, air, view, moment)

    monkeypatch.setattr("app.capture.burst.open_camera", broken)
    begun: list[Path] = []
    with (
        open_camera(experiment, "still") as camera,
        pytest.raises(BadInputError, match="second camera"),
    ):
        take(camera, experiment, CapturePlan(frames=2), watch=BurstWatch(begun=begun.append))
    assert experiment.latest_capture("reference") == before
    assert begun[0].is_dir() is False or not (begun[0] / "manifest.json").exists()


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
