"""Each nuisance of a simulated world does what its unit says."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import ndimage

from app.experiment.rig_settings import World
from app.rig.nuisances import covered, spoiled
from app.rig.rendered import _before_the_mount_crept, drifted
from app.volume.file import read_volume
from app.volume.scene import RigOptions, room_scene
from core.geometry import Optics
from drivers.simulated import SensorNoise, SimulatedCamera
from tests.app.capture.test_series import ROOM

SHAPE = (240, 320)


def plain(value=0.5):
    return np.full(SHAPE, value, np.float32)


def test_an_ideal_world_changes_nothing():
    picture = np.random.default_rng(0).random(SHAPE).astype(np.float32)
    np.testing.assert_array_equal(spoiled(picture, World(), 1, 3), picture)


def test_a_blur_is_as_wide_as_stated_and_a_shake_adds_to_it():
    point = np.zeros(SHAPE, np.float32)
    point[120, 160] = 1.0
    y = np.arange(SHAPE[0])[:, None] - 120
    still = spoiled(point, World(blur_px=1.5), 0, 0)
    assert np.sqrt((still * y**2).sum() / still.sum()) == pytest.approx(1.5, rel=0.02)
    widths = []
    for burst in range(8):
        shaken = spoiled(point, World(blur_px=1.5, vibration_px=2.0), burst, 0)
        widths.append(np.sqrt((shaken * y**2).sum() / shaken.sum()))
    assert min(widths) >= np.hypot(1.5, 1.0) * 0.97
    assert max(widths) <= np.hypot(1.5, 3.0) * 1.01
    assert max(widths) > 1.1 * min(widths)


def test_the_corners_lose_the_stated_share():
    seen = spoiled(plain(), World(vignetting=0.4), 0, 0)
    assert seen[0, 0] == pytest.approx(0.3, rel=0.01)
    assert seen[120, 160] == pytest.approx(0.5, rel=0.01)


def test_the_lamp_changes_between_bursts_and_ripples_over_the_wall():
    world = World(lamp=0.05)
    levels = [float(spoiled(plain(), world, burst, 1).mean()) for burst in range(20)]
    assert 0.475 <= min(levels) < 0.49 < 0.51 < max(levels) <= 0.525
    rippled = spoiled(plain(), World(ripple=0.02, ripple_period_px=40), 0, 1)
    assert np.ptp(rippled) == pytest.approx(0.02, rel=0.02)
    spectrum = np.abs(np.fft.fft2(rippled - rippled.mean()))
    row, column = np.unravel_index(spectrum.argmax(), SHAPE)
    found = np.hypot(np.fft.fftfreq(SHAPE[0])[row], np.fft.fftfreq(SHAPE[1])[column])
    assert found == pytest.approx(1 / 40, rel=0.15)


def test_hot_pixels_are_as_many_as_stated_and_stay_where_they_are():
    first, second = (spoiled(plain(), World(hot_pixels=0.01), burst, 5) == 1.0 for burst in (0, 1))
    assert first.mean() == pytest.approx(0.01, rel=0.2)
    np.testing.assert_array_equal(first, second)


def test_things_cover_the_stated_share_and_every_second_one_moves():
    world = World(covered=0.1)
    first, second = (covered(SHAPE, world, (burst,), 2) for burst in (0, 1))
    assert first.mean() == pytest.approx(0.1, rel=0.1)
    stayed = (first & second).sum() / first.sum()
    assert 0.8 < stayed < 0.97
    before, after = (spoiled(plain(), world, burst, 2) for burst in (0, 1))
    assert np.all(before[~first] == 0.5)
    assert np.any(before[first & second] != after[first & second])


def test_things_before_the_wall_move_with_the_camera_as_the_picture_does():
    world, by_px = World(covered=0.1), np.array([0.4, -0.3])
    still = spoiled(plain(), world, 0, 2)
    moved = spoiled(plain(), world, 0, 2, lambda points_px: points_px - by_px)

    expected = ndimage.shift(still.astype(float), by_px[::-1], order=5, mode="nearest")
    inside = ndimage.binary_erosion(covered(SHAPE, world, (0,), 2), iterations=4)
    # Their edges ring in the expected picture.
    assert np.abs(moved[inside] - expected[inside]).mean() < 1e-3
    assert np.abs(still[inside] - expected[inside]).mean() > 0.01


def test_a_simulated_camera_s_things_go_where_its_wall_goes():
    scene = room_scene(read_volume(ROOM), RigOptions(camera_px=(320, 240)), "operator")
    experiment = SimpleNamespace(settings=SimpleNamespace(scene=scene))
    crept = drifted(drifted(scene, 0, 0.3, 0.2, seed=1), 0, 0.3, 0.2, seed=2)
    points_m = np.array([[0.0, 0.5, 0.2], [0.9, 0.5, 0.8], [0.3, 0.5, 1.2]])

    def on_panel(camera: Optics) -> np.ndarray:
        x, y, z = camera.rotation @ (points_m - np.array(camera.position_m)).T
        return np.stack([x / z, y / z], axis=-1) * np.array(camera.focal_px) + np.array(camera.principal_px)

    back = _before_the_mount_crept(experiment, crept, 0)  # type: ignore[arg-type]

    before, after = (on_panel(one.views[0].camera) for one in (scene, crept))
    assert np.abs(after - before).max() > 0.1
    np.testing.assert_allclose(back(after), before, atol=1e-6)


def test_the_focus_moves_the_edge_of_the_picture_by_the_stated_length():
    scene = room_scene(read_volume(ROOM), RigOptions(camera_px=(320, 240)), "operator")
    moved = drifted(scene, 0, 0.0, 0.5, seed=1)
    assert drifted(scene, 0, 0.0, 0.0, seed=1) is scene
    focal = scene.views[0].camera.focal_px[0]
    assert abs(moved.views[0].camera.focal_px[0] / focal - 1) * 160 == pytest.approx(0.5)


def test_the_light_of_frames_scatters_by_the_stated_share():
    picture = plain()
    camera = SimulatedCamera(lambda: picture, seed=3, noise=SensorNoise(dark_counts=64.0), flicker=0.05)
    levels = np.array([camera.grab().pixels.mean() - 64 for _ in range(80)])
    assert levels.std() / levels.mean() == pytest.approx(0.05, rel=0.3)
    np.testing.assert_array_equal(camera.expected(7), camera.expected(7))
