from dataclasses import replace

import numpy as np

from core.geometry import Box, looking_along_y
from core.objects import RoomObject
from core.plan.verdicts import hidden_wall
from core.rays.visibility import away_from_walls, hidden_by_objects, sees_wall
from core.scene import FixedTexture, ProjectedPattern, Scene, View

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
# 100 px a metre on the wall, 10 m away; the principal point sees x = 2 m, z = 1.5 m.
CAMERA = looking_along_y(position_m=(2.0, -7.0, 1.5), width_px=420, height_px=320, focal_px=1000.0)
# Its front face is 8 m from the camera: it hides 10 / 8 of its width on the wall.
THING = RoomObject(name="thing", lower_m=(1.6, 1.0, 0.0), upper_m=(2.4, 2.0, 1.9))
SCENE = Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), objects=(THING,))
# Pixels 10 px apart along the row that looks at z = 1.5 m, by where they meet the wall.
X_M = np.arange(0.2, 3.9, 0.1)
PIXELS = np.stack([209.5 + 100.0 * (X_M - 2.0), np.full(len(X_M), 159.5)], axis=1)


def test_an_object_hides_its_shadow_on_the_wall():
    hidden = hidden_by_objects(SCENE, 0, PIXELS, margin_px=0.0)

    assert np.array_equal(hidden, np.abs(X_M - 2.0) < 0.5)
    assert np.array_equal(sees_wall(SCENE, 0, PIXELS, margin_px=0.0), ~hidden)


def test_rays_that_graze_an_object_are_left_out():
    """A margin of 20 px is 0.2 m, by which the thing grows on all sides: its front is then 7.8 m away."""
    grazed = hidden_by_objects(SCENE, 0, PIXELS, margin_px=20.0)

    assert np.array_equal(grazed, np.abs(X_M - 2.0) < 0.6 * 10.0 / 7.8)
    assert away_from_walls(SCENE, 0, PIXELS, 0.01).sum() < sees_wall(SCENE, 0, PIXELS, 0.0).sum()


def test_what_keeps_the_projector_from_the_wall_hides_it_too():
    lamp = looking_along_y(position_m=(0.0, -7.0, 1.5), width_px=800, height_px=600, focal_px=800.0)
    lit = replace(SCENE, light=ProjectedPattern(projector=lamp))

    hidden = hidden_by_objects(lit, 0, PIXELS, margin_px=0.0)

    # From x = 0 the thing's shadow runs from 1.6 * 10 / 9 (its rear edge) to 2.4 * 10 / 8 m.
    assert np.array_equal(hidden, ((X_M > 1.5) & (X_M < 2.5)) | ((X_M > 16.0 / 9.0) & (X_M < 3.0)))


def test_pixels_beyond_where_the_lens_turns_back_see_nothing():
    # r (1 - 10 r^2) grows up to r = 0.18, whose picture is 122 px from the axis.
    camera = replace(CAMERA, distortion=(-10.0, 0.0, 0.0, 0.0, 0.0))
    scene = replace(SCENE, views=(View(camera=camera),), objects=())

    seen = sees_wall(scene, 0, PIXELS, margin_px=0.0)

    assert np.array_equal(seen, np.abs(PIXELS[:, 0] - 209.5) < 121.7)


def test_without_objects_nothing_is_hidden():
    assert not hidden_by_objects(replace(SCENE, objects=()), 0, PIXELS, margin_px=50.0).any()


def test_the_plan_says_how_much_of_the_wall_is_hidden():
    """The thing hides 1 m x 2 m (8 m to its front) of 4 m x 3 m, and margins of 8 px (0.08 m) more."""
    said = hidden_wall(SCENE, 0, 8)

    share = float(said.split("hide ")[1].split(" %")[0])
    assert 14.0 < share < 25.0
    assert "That is much" not in said
    big = replace(THING, lower_m=(0.2, 1.0, 0.0), upper_m=(3.8, 2.0, 2.5))
    assert "That is much" in hidden_wall(replace(SCENE, objects=(big,)), 0, 8)
    assert hidden_wall(replace(SCENE, objects=()), 0, 8) == ""
