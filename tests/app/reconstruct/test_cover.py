"""What stands before the wall is found in the reference, though it stands in both pictures."""

import numpy as np
import pytest

from app.reconstruct.cover import covered_windows, reached_from
from app.rig.nuisances import covered, spoiled
from app.simulate.worlds import LAB
from app.volume.file import read_volume
from app.volume.scene import RigOptions, room_scene
from core.displacement import window_centres
from core.rays.visibility import sees_wall
from core.render import render_reference
from tests.app.capture.test_series import ROOM

WINDOW_PX = 16


def seen(light, pattern_seed=0):
    options = RigOptions(
        camera_px=(1280, 960), stand_off_m=4.0, baseline_m=(1.0, 1.0), light=light, pattern_seed=pattern_seed
    )
    scene = room_scene(read_volume(ROOM), options, "operator")
    return scene, render_reference(scene)


def noisy(picture, share, seed=3):
    world = LAB.world.model_copy(update={"covered": share})
    noise = np.random.default_rng(seed).standard_normal(picture.shape)
    return (spoiled(picture, world, 0, seed) + 1e-3 * noise).astype(np.float32), world


@pytest.mark.parametrize("light", ["texture", "projector"])
def test_a_tenth_of_the_wall_behind_things_is_found_in_a_labs_light(light):
    scene, picture = seen(light)
    shown, world = noisy(picture, 0.1)

    found = covered_windows(scene, 0, shown, WINDOW_PX)

    rows, columns = (n // WINDOW_PX for n in shown.shape)
    behind = covered(shown.shape, world, (0,), 3).reshape(rows, WINDOW_PX, columns, WINDOW_PX).mean((1, 3))
    centres = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2) * WINDOW_PX + 7.5
    on_wall = sees_wall(scene, 0, centres, margin_px=float(WINDOW_PX))
    whole, free = (behind.ravel() == 1.0) & on_wall, (behind.ravel() == 0.0) & on_wall
    assert whole.sum() > 30
    assert found[whole].mean() > 0.95
    assert found[free].mean() < 0.02


@pytest.mark.parametrize("seed", range(6))
def test_a_thing_narrower_than_three_small_windows_is_found_as_well(seed):
    """A block of three then always has a free part, and the paint of two and a half windows is like some pattern."""
    window_px = 8
    options = RigOptions(camera_px=(512, 384), stand_off_m=4.0, pattern_seed=seed)
    scene = room_scene(read_volume(ROOM), options, "operator")
    shown, world = noisy(render_reference(scene), 0.05, seed)

    found = covered_windows(scene, 0, shown, window_px)

    behind = covered(shown.shape, world, (0,), seed)
    rows, columns = (n // window_px for n in shown.shape)
    whole = behind.reshape(rows, window_px, columns, window_px).all((1, 3)).ravel()
    whole &= sees_wall(scene, 0, window_centres(shown.shape, window_px), margin_px=float(window_px))
    left_out = reached_from(found, shown.shape, window_px)
    assert whole.sum() > 40
    assert left_out[whole].all()


def test_nothing_is_said_to_stand_before_a_free_wall():
    scene, picture = seen("texture")
    assert covered_windows(scene, 0, noisy(picture, 0.0)[0], WINDOW_PX).mean() < 0.005


def test_another_pattern_than_the_stated_one_is_no_cover():
    scene, _ = seen("texture")
    _, other = seen("texture", pattern_seed=5)
    assert not covered_windows(scene, 0, noisy(other, 0.0)[0], WINDOW_PX).any()


@pytest.mark.parametrize(("window_px", "reach"), [(16, 1), (8, 2)])
def test_windows_whose_gradient_reaches_into_a_covered_one_are_left_out_with_it(window_px, reach):
    covered = np.zeros((6, 9), bool)
    covered[2, 4] = True

    found = reached_from(covered.ravel(), (6 * window_px + 3, 9 * window_px), window_px).reshape(6, 9)

    # The derivative's filter has ten taps on each side.
    expected = np.zeros_like(covered)
    expected[max(2 - reach, 0) : 3 + reach, 4 - reach : 5 + reach] = True
    np.testing.assert_array_equal(found, expected)
