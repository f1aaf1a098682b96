from typing import get_args

import pytest

from app.errors import BadInputError
from app.reconstruct.presets import PRESETS, preset, resolved
from core.geometry import Box, WallName, looking_along_y
from core.scene import FixedTexture, Inlet, Patch, Scene, View, Wall

SUPPLY = Inlet(
    patch=Patch(wall="x_min", lower_m=(0.7, 1.1), upper_m=(1.3, 1.5)),
    temperature_k=303.15,
    velocity_m_s=(0.4, 0.0, 0.0),
)
WALLS = tuple(Wall(wall=name, thermal="adiabatic") for name in get_args(WallName))


def scene(*parts) -> Scene:
    camera = looking_along_y(position_m=(1.0, -8.0, 1.0), width_px=40, height_px=40, focal_px=90.0)
    room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 2.0))
    return Scene(room=room, views=(View(camera=camera),), light=FixedTexture(), boundary=parts)


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ((SUPPLY, *WALLS), "standard"),
        (WALLS, "draft"),
        ((SUPPLY, *WALLS[1:]), "draft"),
        ((SUPPLY, Wall(wall="x_min"), *WALLS[1:]), "draft"),
    ],
)
def test_auto_marches_the_room_where_supply_and_walls_are_stated(parts, expected: str):
    assert resolved("auto", scene(*parts)) == expected
    assert resolved("paper", scene(*parts)) == "paper"
    assert expected in PRESETS


def test_an_unknown_preset_is_refused_with_the_known_ones():
    with pytest.raises(BadInputError, match="known: auto, draft"):
        preset("best")
