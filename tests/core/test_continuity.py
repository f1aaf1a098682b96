"""A shift that no air has stands alone; one that air has is reached over its neighbours, however large it is."""

from dataclasses import replace

import numpy as np
import pytest

from core.continuity import left_out, moved_as_air
from core.geometry import looking_along_y
from core.motion import MOTIONS, CameraMotion
from core.problem import ShiftMeasurement

NOISE_PX = 0.004
EVERYWHERE = np.ones(64 * 48, bool)
CAMERA = looking_along_y(position_m=(2.0, -1.0, 1.35), width_px=512, height_px=384, focal_px=480.0)


def plume(strength_px: float, wide_px: float, seed=0) -> ShiftMeasurement:
    """Faint shifts all over the picture, and a narrow upright plume in its middle."""
    places = np.stack(np.meshgrid(np.arange(3.5, 512, 8), np.arange(3.5, 384, 8)), -1).reshape(-1, 2)
    x = (places[:, 0] - 256) / wide_px
    shift = 0.02 * np.sin(places[:, ::-1] / 60) + NOISE_PX * np.random.default_rng(seed).standard_normal(
        places.shape
    )
    shift[:, 0] += strength_px * x * np.exp(0.5 - x**2 / 2)
    return ShiftMeasurement(
        places, shift, np.broadcast_to(np.eye(2) / NOISE_PX**2, (len(shift), 2, 2)).copy(), 8
    )


def moved(measured: ShiftMeasurement, by_px) -> tuple[ShiftMeasurement, np.ndarray]:
    """The same with a thing of two by three windows that moved."""
    on_it = np.all(np.abs(measured.centres_px - (104, 300)) < (8, 12), axis=1)
    return replace(measured, displacement_px=np.where(on_it[:, None], by_px, measured.displacement_px)), on_it


@pytest.mark.parametrize("strength_px", [0.0, 0.3, 4.0])
@pytest.mark.parametrize("seed", range(5))
def test_noise_and_a_plume_move_the_pattern_as_air_does(strength_px, seed):
    measured = plume(strength_px, 24.0, seed)
    moved = moved_as_air(measured, EVERYWHERE)
    assert moved.all()
    assert left_out([moved]) == ()


@pytest.mark.parametrize("strength_px", [0.0, 0.3])
def test_a_thing_that_moved_by_pixels_did_not(strength_px):
    measured, on_it = moved(plume(strength_px, 24.0), (4.0, -0.3))
    assert on_it.sum() == 6
    found = moved_as_air(measured, EVERYWHERE)
    np.testing.assert_array_equal(found, ~on_it)
    assert left_out([found, found])[0].startswith("12 of 6144 windows (0.2 %) show")


def test_the_motion_of_the_camera_is_no_step():
    measured, on_it = moved(plume(0.3, 24.0), (4.0, -0.3))
    motion = CameraMotion(CAMERA, np.eye(MOTIONS))
    crept = replace(measured, displacement_px=measured.displacement_px + np.array([0.8, -0.5]), motion=motion)
    np.testing.assert_array_equal(moved_as_air(crept, EVERYWHERE), ~on_it)


def test_a_window_without_texture_is_not_judged():
    measured = plume(0.0, 24.0)
    measured.displacement_px[500] = 300.0
    measured.information_per_px2[500] = 1e-6 * np.eye(2)
    assert moved_as_air(measured, EVERYWHERE).all()


def test_where_the_air_ends_its_shift_may_end_too():
    measured = plume(0.3, 24.0)
    through_air = np.abs(measured.centres_px - (256, 192)).max(axis=1) < 40
    measured.displacement_px[:] = np.where(through_air[:, None], measured.displacement_px + 2.0, 0.0)
    assert moved_as_air(measured, through_air).all()
    assert not moved_as_air(measured, EVERYWHERE).all()
