from dataclasses import replace

import numpy as np

from app.rig.rendered import with_objects
from core.geometry import Box, looking_along_y
from core.objects import RoomObject
from core.rays.visibility import hidden_by_objects
from core.scene import FixedTexture, Scene, View

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
