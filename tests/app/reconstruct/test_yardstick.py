"""Marks that somebody drew: believed where they move like one rigid picture, else refused by name."""

import numpy as np
import pytest

from app.reconstruct.drift import mount, without_known_drift
from app.reconstruct.yardstick import Yardstick
from core.motion import motion_basis
from core.rays.visibility import sees_wall
from core.scene import FixedTexture, Marks, Scene, View
from core.setting import SettingError
from tests.app.reconstruct.test_drift import (
    BEYOND,
    CENTRES,
    CREEP_PX,
    LENS,
    air_everywhere,
    exposures,
    still_air,
)
from tests.app.reconstruct.test_problem import CAMERA, ROOM

# The middle of the picture.
MIDDLE = motion_basis(np.array([[127.5, 111.5]]), LENS)[0]
NOTHING = np.zeros(len(CENTRES), bool)


def board(name, left, top, right, bottom):
    inside = np.all((CENTRES > [left, top]) & (CENTRES < [right, bottom]), axis=1)
    return Yardstick(f"marks {name!r}", inside)


LEFT, RIGHT = board("left", 16, 16, 88, 88), board("right", 168, 16, 240, 88)
LOW = board("low", 16, 136, 88, 208)


def air_before_the_right_one(x, y):
    there = np.exp(-40 * ((x - 0.8) ** 2 + (y - 0.22) ** 2))
    return 0.05 * there * np.sin(30 * x), 0.05 * there * np.cos(25 * y)


def pushed_right(x, y):
    return 0.05 * (x > 0.5), 0.0 * y


def drift_of(pictures, *marks):
    return without_known_drift(pictures, ~BEYOND, NOTHING, mount(1.0), marks)


def test_still_marks_give_the_creep_with_its_deviation():
    off = []
    for seed in range(6):
        shift, drift_px, note = drift_of(exposures(seed, still_air), LEFT, RIGHT)
        assert "from the marks 'left' and marks 'right'" in note
        assert shift.motion is not None
        off.append(np.linalg.solve(shift.motion.root_px, drift_px - CREEP_PX))
    # The creep lies as far from what was found as its deviation says, in what the marks tell: 36 draws of a unit
    # normal, less what the prior of 1 px (the creep is a seventh of it) leaves untold.
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_marks_that_the_rooms_air_is_before_are_refused_by_name():
    pictures = exposures(1, air_before_the_right_one)
    _, drift_px, note = drift_of(pictures, LEFT, RIGHT)
    assert "The marks 'right' cannot tell the camera's motion: what a rigid motion leaves" in note
    assert "from the marks 'left';" not in note.split("from the marks 'left'")[0]
    assert (MIDDLE @ (drift_px - CREEP_PX))[0] == pytest.approx(0.0, abs=0.1)
    shift, drift_px, note = drift_of(exposures(1, air_everywhere), LEFT, RIGHT)
    assert "cannot tell" in note
    assert not drift_px.any()
    assert shift.motion is not None
    np.testing.assert_allclose(shift.motion.root_px, np.eye(6))


def test_a_board_that_somebody_pushed_is_found_among_three_and_of_two_both_are_refused():
    pictures = exposures(2, pushed_right)
    _, drift_px, note = drift_of(pictures, LEFT, RIGHT, LOW)
    assert "The marks 'right' do not move as the others do" in note
    assert "from the marks 'left' and marks 'low'" in note
    assert (MIDDLE @ (drift_px - CREEP_PX))[0] == pytest.approx(0.0, abs=0.02)
    _, drift_px, note = drift_of(pictures, LEFT, RIGHT)
    assert "The marks 'left' and marks 'right' do not move alike" in note
    assert not drift_px.any()


def test_marks_of_hardly_a_window_and_bare_ones_are_refused():
    _, _, note = drift_of(exposures(3, still_air), board("speck", 20, 20, 30, 30), LEFT, RIGHT)
    assert "The marks 'speck' cannot tell the camera's motion: 1 windows lie in it" in note
    assert "from the marks 'left' and marks 'right'" in note
    bare = board("bare", 0, 0, 48, 224)
    _, _, note = drift_of(exposures(3, still_air, textured=False), bare)
    assert "The marks 'bare' cannot tell the camera's motion: 0 of its" in note
    assert "No part of the picture" in note


def test_marks_hide_the_wall_and_lie_in_the_picture():
    drawn = Marks(name="board", lower_px=(10.0, 20.0), upper_px=(60.0, 70.0))
    scene = Scene(room=ROOM, views=(View(camera=CAMERA, marks=(drawn,)),), light=FixedTexture())
    pixels = np.array([[35.0, 45.0], [62.0, 45.0], [70.0, 45.0]])
    np.testing.assert_array_equal(sees_wall(scene, 0, pixels, 5.0)[:2], [False, False])
    plain = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture())
    assert sees_wall(scene, 0, pixels, 5.0)[2] == sees_wall(plain, 0, pixels, 5.0)[2]
    with pytest.raises(SettingError, match=r"The marks 'far' reach from .* Draw them within it"):
        View(camera=CAMERA, marks=(Marks(name="far", lower_px=(10.0, 20.0), upper_px=(9000.0, 70.0)),))
    with pytest.raises(SettingError, match="'flat' have no area"):
        Marks(name="flat", lower_px=(5.0, 5.0), upper_px=(5.0, 9.0))
    with pytest.raises(SettingError, match="a name of its own"):
        View(camera=CAMERA, marks=(drawn, drawn))


def test_the_creep_is_known_best_where_the_marks_stand():
    shift, _, _ = drift_of(exposures(4, still_air), LEFT, RIGHT)
    assert shift.motion is not None
    at = np.array([[128.0, 52.0], [128.0, 200.0]])
    near_px, far_px = np.linalg.norm(shift.motion.at(at), axis=(1, 2))
    assert near_px < 0.7 * far_px
