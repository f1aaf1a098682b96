import numpy as np
import pytest

from core.geometry import Box
from core.occupied import OccupiedZone, at_height, inside
from core.setting import SettingError

ROOM = Box(lower_m=(-1.0, 0.0, 0.5), upper_m=(3.0, 3.0, 3.5))


def test_the_zone_keeps_from_walls_and_ends_above_heads():
    low, high = OccupiedZone().box(ROOM)
    assert low == pytest.approx((-0.4, 0.6, 0.6))
    assert high == pytest.approx((2.4, 2.4, 2.3))


def test_a_low_room_ends_the_zone_at_its_ceiling():
    low_room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(3.0, 3.0, 1.0))
    assert OccupiedZone().box(low_room)[1][2] == 1.0


def test_a_room_of_walls_alone_is_refused():
    with pytest.raises(SettingError, match=r"Give a smaller distance"):
        OccupiedZone().box(Box(lower_m=(0.0, 0.0, 0.0), upper_m=(1.2, 3.0, 3.0)))


def test_vertices_in_a_box():
    axes = (np.linspace(0, 4, 5), np.linspace(0, 3, 4), np.linspace(0, 2, 3))
    found = inside(axes, (1.0, 0.0, 0.1), (2.0, 3.0, 1.9))
    assert found.sum() == 2 * 4 * 1
    assert found[1, 0, 1]


def test_a_box_between_vertices_takes_the_nearest():
    axes = (np.linspace(0, 4, 5), np.linspace(0, 3, 4), np.linspace(0, 2, 3))
    found = inside(axes, (1.2, 0.0, 0.0), (1.6, 3.0, 2.0))
    assert found.any(axis=(1, 2)).tolist() == [False, True, False, False, False]


def test_a_plane_between_vertices_is_linear():
    z_m = np.linspace(0.5, 3.5, 7)
    field = np.broadcast_to(10.0 * (z_m - 0.5), (2, 3, 7))
    np.testing.assert_allclose(at_height(field, z_m, 1.1), 11.0)
    np.testing.assert_allclose(at_height(field, z_m, 3.0), 30.0)
