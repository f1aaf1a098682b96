from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from app.experiment.folder import ExperimentSettings, create_experiment, open_experiment
from app.experiment.rig_settings import RigSettings, SimulatedCameraSettings
from app.reconstruct.drift import mount
from app.reconstruct.yardstick import Exposures, read_motion
from app.rig.beyond_wall import with_marks
from app.rig.open import air_of, open_camera
from app.rig.rendered import seen_picture, with_objects
from app.simulate.experiment import simulate
from app.volume.scene import RigOptions
from core.displacement import window_centres
from core.geometry import Box, looking_along_y
from core.motion import motion_basis
from core.objects import RoomObject
from core.rays.visibility import hidden_by_objects, sees_wall
from core.scene import FixedTexture, Marks, Scene, View
from drivers.burst import CapturePlan
from drivers.capture import run_capture
from tests.rooms import ROOM as VOLUME

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
CAMERA = looking_along_y(position_m=(2.0, -7.0, 1.5), width_px=84, height_px=64, focal_px=200.0)
THING = RoomObject(name="thing", lower_m=(1.6, 1.0, 0.0), upper_m=(2.4, 2.0, 1.9))
SCENE = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), objects=(THING,))


def test_a_picture_shows_objects_exactly_where_they_hide_the_wall():
    wall = np.full((64, 84), 0.99, np.float32)

    seen = with_objects(wall, SCENE, 0)

    pixels = np.stack(np.meshgrid(np.arange(84.0), np.arange(64.0)), axis=-1).reshape(-1, 2)
    hidden = hidden_by_objects(SCENE, 0, pixels, margin_px=0.0).reshape(64, 84)
    assert np.array_equal(seen != wall, hidden)
    assert 0.02 <= seen[hidden].min() < seen[hidden].max() <= 0.9
    assert with_objects(wall, replace(SCENE, objects=()), 0) is wall


def test_a_board_is_drawn_wherever_the_view_has_marks_and_is_out_of_focus():
    wall = np.full((64, 84), 0.99, np.float32)
    marks = Marks(name="board", lower_px=(20.0, 20.0), upper_px=(60.0, 44.0))
    marked = replace(SCENE, views=(View(camera=CAMERA, marks=(marks,)),), objects=())
    sharp, soft = (with_marks(wall, marked, 0, 200.0, blur_px) for blur_px in (0.0, 8.0))
    rows, columns = np.nonzero(sharp != wall)
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (12, 68, 12, 52)
    inner = np.s_[24:40, 24:56]
    assert sharp[inner].std() > 0.02
    assert np.abs(np.diff(soft[inner])).mean() < 0.5 * np.abs(np.diff(sharp[inner])).mean()
    assert with_marks(wall, SCENE, 0, 200.0, 1.0) is not None
    np.testing.assert_array_equal(with_marks(wall, SCENE, 0, 200.0, 1.0), wall)


def test_beyond_the_wall_the_rooms_other_walls_move_with_the_air_and_a_frame_does_not(tmp_path):
    camera, moved = SimulatedCameraSettings(noise_free=True), {}
    options = RigOptions(camera_px=(160, 120), frames=1, stand_off_m=4.0)
    experiment = open_experiment(simulate(VOLUME, tmp_path / "e", options, "operator", camera))
    wall = seen_picture(experiment, camera.model_copy(update={"border": "bare"}), "still", 0, 0) > 0
    beside = np.asarray(binary_dilation(wall, iterations=6), bool) & ~np.asarray(binary_dilation(wall), bool)
    for border in ("bare", "print", "room"):
        shown = camera.model_copy(update={"border": border})
        still, flow = (seen_picture(experiment, shown, air, 0, 0) for air in ("still", "moving"))
        change = np.abs(flow - still)
        moved[border] = float(still[beside].std()), float(change[beside].mean()), float(change[wall].mean())
    assert moved["bare"][:2] == (0.0, 0.0)
    assert moved["print"][0] > 0.03
    assert moved["print"][1] == 0.0
    # What is seen of the side walls lies near the back wall, behind nearly as much air; its print is coarser.
    assert moved["room"][0] > 0.03
    assert moved["room"][1] > 0.05 * moved["room"][2] > 0.0


def test_a_frame_that_ends_within_the_picture_tells_the_same_motion_as_the_wall_does(tmp_path):
    """A side wall is narrow: left and right of its frame nothing is seen. Both show the mount alone."""
    camera = SimulatedCameraSettings(noise_free=True, drift_px=0.1)
    options = RigOptions(camera_px=(256, 192), frames=1, stand_off_m=4.0, walls=("x_max",))
    experiment = open_experiment(simulate(VOLUME, tmp_path / "e", options, "operator", camera))
    scene = experiment.settings.scene
    before, after = (seen_picture(experiment, camera, "still", 0, steps) for steps in (0, 1))
    assert (before == 0).mean() > 0.1

    optics, variance = scene.views[0].camera, np.full(before.shape, 1e-6, np.float32)
    exposures = Exposures(before, after, variance, 8, optics)
    centres = window_centres(before.shape, 8)
    on_wall, around = (sees_wall(scene, 0, centres, margin_px=margin) for margin in (8.0, -14.0))
    by_wall, by_border = (read_motion(exposures, where, mount(1.0)) for where in (on_wall, ~around))

    assert by_wall is not None
    assert by_border is not None
    apart_px = motion_basis(centres, optics) @ (by_border.motion_px - by_wall.motion_px)

    assert np.sqrt(np.mean(np.sum(apart_px**2, axis=1))) < 0.005


def test_dark_frames_are_taken_with_the_lens_covered(tmp_path):
    settings = ExperimentSettings(rig=RigSettings(camera=SimulatedCameraSettings()), scene=SCENE)
    experiment = create_experiment(tmp_path / "one", settings)
    with open_camera(experiment, air_of("dark")) as camera:
        burst = run_capture(camera, CapturePlan(role="dark", frames=2))
    assert burst.verdicts[0].name == "dark level"
    assert all(one.good for one in burst.verdicts)
    assert burst.mean.std() > 0.0


def test_half_the_exposure_gives_half_the_light(tmp_path):
    options, light = RigOptions(camera_px=(160, 120), frames=1, stand_off_m=4.0), {}
    for exposure_s in (0.01, 0.02):
        settings = SimulatedCameraSettings(exposure_s=exposure_s)
        experiment = open_experiment(
            simulate(VOLUME, tmp_path / f"{exposure_s}", options, "operator", settings)
        )
        noise = experiment.settings.scene.views[0].noise
        dark = noise.dark_counts / (2**noise.bits - 1)
        with open_camera(experiment, "still") as camera:
            light[exposure_s] = float(np.mean(run_capture(camera, CapturePlan(frames=2)).mean)) - dark
    assert light[0.02] == pytest.approx(2.0 * light[0.01], rel=0.01)
