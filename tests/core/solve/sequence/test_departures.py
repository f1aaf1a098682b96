"""Bursts of a turbulent field that is drawn: its size, its length, and each burst in its interval."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from core.displacement import window_centres
from core.geometry import Box, looking_along_y
from core.known_temperature import VertexGrid
from core.motion import CameraMotion
from core.objects import RoomObject
from core.problem import ShiftMeasurement
from core.rays.operator import build
from core.rays.visibility import sees_wall
from core.result import Solution
from core.scene import FixedTexture, Scene, View
from core.setting import SettingError
from core.solve.sequence.departures import joined, solve_departures
from core.solve.sequence.modes import longest
from core.watch import StoppedError, Watch

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
CAMERA = looking_along_y(position_m=(2.0, -27.0, 1.5), width_px=600, height_px=450, focal_px=4200.0)
SCENE = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture())
BURSTS, STD_K, LENGTH_M, WINDOW_PX = 12, 0.4, 0.4, 10
# A picture moves by up to this much of its own accord between two bursts, which its border does not tell.
MOTION_PX = 0.02


def mean_air() -> Solution:
    grid = VertexGrid(ROOM, (17, 13, 13))
    x, y, z = grid.axes_m
    return Solution(x, y, z, np.broadcast_to(294.0 + 2.0 * z / 3.0, grid.shape))


def drawn(noise_px, seed=0):
    """The air of every burst on the mean's vertices, and what the camera saw of it."""
    rng = np.random.default_rng(seed)
    modes, mean = longest(ROOM, 1500), mean_air()
    weights = STD_K * modes.amplitudes(LENGTH_M)[:, None] * rng.standard_normal((modes.count, BURSTS))
    centres = window_centres((450, 600), WINDOW_PX)
    centres = centres[sees_wall(SCENE, 0, centres, margin_px=float(WINDOW_PX))]
    rays = build(SCENE, 0, centres, modes.grid.shape, float(WINDOW_PX))
    slope = -SCENE.air.ambient_refractivity * SCENE.air.ambient_temperature_k / 295.0**2
    motion = CameraMotion(SCENE.views[0].camera, MOTION_PX * np.eye(6))
    bursts = []
    for one in weights.T:
        seen = np.asarray(rays.apply(jnp.asarray(slope * modes.sum(one, modes.grid.axes_m), jnp.float32)))
        seen = seen + motion.at(centres) @ rng.standard_normal(6) + noise_px * rng.standard_normal(seen.shape)
        information = np.tile(np.eye(2) / noise_px**2, (len(centres), 1, 1))
        bursts.append((ShiftMeasurement(centres, seen, information, WINDOW_PX, motion=motion),))
    axes_m = (mean.x_m, mean.y_m, mean.z_m)
    return np.stack([modes.sum(one, axes_m) for one in weights.T]), bursts


@pytest.fixture(scope="module")
def clear():
    air, bursts = drawn(noise_px=1e-3)
    return air, solve_departures(SCENE, mean_air(), bursts, np.arange(float(BURSTS)))


def error_k(air, found):
    return found.temperature_k - (air - air.mean(axis=0))


def test_the_fields_size_and_length_are_those_that_were_drawn(clear):
    _, found = clear
    assert found.field_std_k == pytest.approx(STD_K, rel=0.25)
    assert found.field_length_m == pytest.approx(LENGTH_M, rel=0.35)


def test_bursts_lie_in_their_intervals_and_nearer_than_the_mean(clear):
    air, found = clear
    error = error_k(air, found)
    moved = air - air.mean(axis=0)
    held = np.abs(error) <= 1.96 * found.temperature_std_k
    assert 0.90 < held.mean() < 0.985
    assert np.sqrt((error**2).mean()) < 0.95 * np.sqrt((moved**2).mean())
    # The deviation tells how large the error is.
    assert np.sqrt((error**2).mean()) == pytest.approx(np.sqrt((found.temperature_std_k**2).mean()), rel=0.15)
    assert np.sqrt((moved**2).mean()) == pytest.approx(np.sqrt((found.rms_k**2).mean()), rel=0.15)


def test_in_pictures_of_noise_nothing_is_seen_and_the_interval_holds():
    air, bursts = drawn(noise_px=0.05, seed=3)
    noisy = solve_departures(SCENE, mean_air(), bursts, np.arange(float(BURSTS)))
    assert np.sqrt((noisy.temperature_k**2).mean()) < 0.1 * STD_K
    assert (np.abs(error_k(air, noisy)) <= 1.96 * noisy.temperature_std_k).mean() > 0.95
    assert noisy.temperature_std_k.max() < 5 * STD_K


def test_squares_of_windows_say_what_their_windows_say_together():
    centres = window_centres((40, 60), WINDOW_PX)
    rng = np.random.default_rng(1)
    information = np.tile(np.diag([4.0, 9.0]), (len(centres), 1, 1))
    shift = ShiftMeasurement(centres, rng.standard_normal((len(centres), 2)), information, WINDOW_PX)
    two = joined(shift, 2)
    assert len(two.centres_px) == 6
    assert two.window_px == 2 * WINDOW_PX
    corner = (centres < 2 * WINDOW_PX).all(axis=1)
    assert corner.sum() == 4
    np.testing.assert_allclose(two.displacement_px[0], shift.displacement_px[corner].mean(axis=0))
    np.testing.assert_allclose(two.information_per_px2[0], 4 * information[0])
    assert joined(shift, 1) is shift


def test_a_stop_is_heard_and_two_bursts_are_too_few():
    _, bursts = drawn(noise_px=0.01)
    with pytest.raises(StoppedError):
        solve_departures(SCENE, mean_air(), bursts, np.arange(float(BURSTS)), Watch(should_stop=lambda: True))
    with pytest.raises(SettingError, match="at least 3"):
        solve_departures(SCENE, mean_air(), bursts[:2], np.arange(2.0))


def test_objects_hold_no_air_in_the_bursts_either(clear):
    _, found = clear
    box = RoomObject(name="box", lower_m=(1.0, 1.0, 0.0), upper_m=(2.0, 2.0, 1.0))
    left = replace(mean_air(), departures=found).without_objects((box,))
    assert np.isnan(left.departures.temperature_k[:, ~left.air]).all()
    assert np.isfinite(left.departures.temperature_k[:, left.air]).all()
    assert np.isnan(left.departures.rms_k[~left.air]).all()
