"""An experiment with two views: simulated, and captured in turn or at once by every door's own function."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.capture.burst import take
from app.capture.retake import retake, to_retake
from app.capture.watched import BurstWatch
from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.capture_parts import parts_of
from app.experiment.captures import load_capture, newest_pair
from app.experiment.folder import open_experiment, save_settings
from app.experiment.rig_settings import V4l2CameraSettings
from app.files.provenance import sha256
from app.rig.open import air_of, named_camera, open_camera
from app.whereabouts import whereabouts
from drivers.burst import CapturePlan
from drivers.clock import SystemClock
from drivers.errors import DeviceBusyError
from drivers.simulated import CameraFault, SimulatedCamera
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
        "--border",
        "bare",
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


def without_the_second(monkeypatch):
    """The second camera does not answer."""

    def broken(experiment, air, view=0, moment=None):
        if view == 1:
            raise BadInputError("The second camera does not answer.")
        return open_camera(experiment, air, view, moment)

    monkeypatch.setattr("app.capture.burst.open_camera", broken)


def run(*arguments):
    return CliRunner().invoke(create_cli(), [str(one) for one in arguments])


def test_a_camera_that_fails_in_its_turn_leaves_no_measurement_and_is_taken_alone(
    folder, monkeypatch, tmp_path
):
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

    # Where no reference is finished, it is what comes next; of a capture that was imported it cannot be taken.
    alone = tmp_path / "room"
    shutil.copytree(folder, alone, ignore=lambda at, names: [n for n in names if n == before.name])
    following = whereabouts(alone, "EXP").next
    assert following.command == f"airlens capture retake EXP --view 'camera at x_max' --capture {kept.name}"
    assert "lacks the picture of camera at x_max" in following.reason
    about = alone / "captures" / kept.name / "incomplete.json"
    about.write_text(json.dumps(json.loads(about.read_text()) | {"origin": {"rig": "imported"}}))
    assert whereabouts(alone, "EXP").next.command.startswith("airlens capture reference EXP")

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


def test_a_real_rig_names_the_camera_of_each_view(folder, tmp_path):
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
    save_settings(copy := Path(shutil.copytree(folder, tmp_path / "room")), whole.settings)
    assert whereabouts(copy).has["rig"].startswith("cameras /dev/video0, /dev/video2 before")


@pytest.mark.parametrize("views", ["q", "y,y_max", "", "y,,x"])
def test_walls_that_are_none_are_refused(views, tmp_path):
    done = CliRunner().invoke(
        create_cli(), ["simulate", str(tmp_path / "room"), "--truth", str(ROOM), "--views", views]
    )
    assert done.exit_code != 0
    assert isinstance(done.exception, BadInputError)
    assert "expected" in str(done.exception)


def test_cameras_at_once_begin_together_and_the_manifest_says_how_far_apart(folder):
    experiment = open_experiment(folder)
    # The second camera settles late: its frames are equally bright only from the sixth on.
    dim = [0.2, 0.5, 0.3, 0.6, 0.4, 0.5]
    looks: list[int] = []

    def late() -> SimulatedCamera:
        pictures = {level: np.full((120, 160), level, np.float32) for level in {*dim, 0.55}}

        def view():
            looks.append(1)
            return pictures[dim[len(looks)] if len(looks) < len(dim) else 0.55]

        return SimulatedCamera(view, seed=3, clock=SystemClock())

    with SimulatedCamera(lambda: np.full((120, 160), 0.5, np.float32), seed=2, clock=SystemClock()) as first:
        plan = CapturePlan(frames=10)
        taken = take(first, experiment, plan, at_once=True, opens=lambda view: late())
        assert taken.shortfall == ""
        apart = load_capture(taken.folder).manifest["origin"]["cameras"]
        assert apart["at_once"] is True
        in_turn = take(first, experiment, plan, opens=lambda view: late())
    later = load_capture(in_turn.folder).manifest["origin"]["cameras"]
    assert later["at_once"] is False
    # Ten frames at 30 a second last 0.33 s: so far apart are two bursts in turn, and none at once.
    assert later["apart_s"] > 0.3
    assert apart["apart_s"] < later["apart_s"]
    shutil.rmtree(taken.folder)
    shutil.rmtree(in_turn.folder)


@pytest.mark.parametrize("pulled", [0, 1])
def test_a_camera_that_is_pulled_out_in_the_middle_costs_the_other_nothing(folder, pulled):
    experiment = open_experiment(folder)
    picture = np.full((120, 160), 0.5, np.float32)

    def camera(view: int) -> SimulatedCamera:
        fault = {pulled: CameraFault.UNPLUG, 1 - pulled: CameraFault.ERROR_FLAG}.get(view)
        return SimulatedCamera(lambda: picture, seed=view, faults=lambda n: fault if n == 5 else None)

    seen: list[int] = []
    watch = BurstWatch(frame=lambda taken, view: seen.append(view))
    with camera(0) as first:
        taken = take(first, experiment, CapturePlan(frames=8), watch=watch, at_once=True, opens=camera)
    names = ("camera", "camera at x_max")
    assert list(taken.failed) == [names[pulled]]
    assert "device lost after" in taken.shortfall
    assert "Plug the camera in" in taken.shortfall
    assert set(seen) == {0, 1}
    # The frame that the other one refused is counted.
    assert taken.burst.refused["corrupt"] == 1
    kept = parts_of(taken.folder, names)
    assert kept.missing == (names[pulled],)
    assert kept.views[1 - pulled]["frames"] == 8
    assert kept.origin["cameras"]["at_once"] is True
    # It is plugged in again and taken alone.
    with camera(2) as again:
        whole = retake(again, experiment, *to_retake(experiment, taken.folder.name, None))
    assert whole.shortfall == ""
    assert load_capture(taken.folder).complete
    assert "cameras" not in load_capture(taken.folder).manifest["origin"]
    shutil.rmtree(taken.folder)


def test_cameras_that_are_all_pulled_out_leave_nothing_to_complete(folder):
    experiment = open_experiment(folder)

    def camera(view: int) -> SimulatedCamera:
        picture = np.full((120, 160), 0.5, np.float32)
        return SimulatedCamera(
            lambda: picture, seed=view, faults=lambda n: CameraFault.UNPLUG if n == 5 else None
        )

    with camera(0) as first:
        taken = take(first, experiment, CapturePlan(frames=8), at_once=True, opens=camera)
    assert list(taken.failed) == ["camera", "camera at x_max"]
    assert taken.shortfall.count("Plug the camera in") == 2
    assert taken.shortfall.endswith("No camera's picture is whole: take it again.")
    assert not load_capture(taken.folder).complete
    shutil.rmtree(taken.folder)


def test_a_camera_that_cannot_stream_beside_the_first_one_has_its_turn_while_that_rests(folder):
    experiment = open_experiment(folder)
    rests: list[bool] = []

    class OnOneLine(SimulatedCamera):
        def close(self):
            rests.append(True)
            super().close()

        def reconnect(self):
            rests.clear()
            super().reconnect()

    picture = np.full((120, 160), 0.5, np.float32)

    def opens(view: int) -> SimulatedCamera:
        if not rests:
            raise DeviceBusyError("There is not enough bandwidth for this camera.")
        return SimulatedCamera(lambda: picture, seed=view)

    with OnOneLine(lambda: picture, seed=9) as first:
        taken = take(first, experiment, CapturePlan(frames=2), opens=opens)
        assert rests == []
        assert first.grab().pixels.shape == (120, 160)
    assert taken.shortfall == ""
    shutil.rmtree(taken.folder)


def test_an_abort_ends_all_cameras_and_keeps_or_discards(folder):
    experiment = open_experiment(folder)
    picture = np.full((120, 160), 0.5, np.float32)
    done: list[int] = []
    watch = BurstWatch(lambda now: done.append(now.done), stop=lambda: "discard" if len(done) > 5 else None)

    def camera(view: int) -> SimulatedCamera:
        return SimulatedCamera(lambda: picture, seed=view)

    with camera(0) as first:
        taken = take(first, experiment, CapturePlan(frames=5000), watch=watch, at_once=True, opens=camera)
    assert taken.folder is None
    assert taken.burst.outcome == "aborted"


def test_preview_and_watch_look_through_the_camera_that_is_named(folder):
    seen = run("preview", folder, "--view", "camera at x_max", "--json")
    assert json.loads(seen.stdout)["camera"] == "simulated camera at x_max"
    looked = run(
        "capture", "watch", folder, "--view", "camera at x_max", "--count", 1, "--every-s", 0, "--json"
    )
    assert looked.exit_code == 0, looked.output
    # Moving air over 160 px: far less than a pixel against the reference of the same camera.
    assert abs(json.loads(looked.stdout)["drift_px"][0]) < 1.0
    assert "has 2 views" in str(run("preview", folder).exception)
