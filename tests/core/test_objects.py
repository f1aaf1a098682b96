import numpy as np
import pytest

from core.geometry import Box
from core.objects import READY, RoomObject, inside_objects, ready_object
from core.result import Solution
from core.setting import SettingError

BOX = RoomObject(name="box", lower_m=(1.0, 1.0, 0.0), upper_m=(2.0, 2.0, 1.0))
AXES = tuple(np.linspace(0.0, 3.0, 7) for _ in range(3))


def solution() -> Solution:
    x, y, z = AXES
    kelvin = 290.0 + np.broadcast_to(z, (7, 7, 7)).astype(np.float32)
    return Solution(x, y, z, kelvin, velocity_m_s=np.ones((7, 7, 7, 3), np.float32))


def test_a_result_has_no_air_in_and_on_objects():
    x, y, z = AXES
    found = solution().without_objects((BOX,))

    assert np.array_equal(~found.air, inside_objects((BOX,), (x, y, z)))
    # Vertices at 1, 1.5 and 2 m along x and y, and at 0, 0.5 and 1 m in height.
    assert (~found.air).sum() == 27
    assert found.velocity_m_s is not None
    assert np.isnan(found.velocity_m_s[2, 2, 0]).all()


def test_filled_gives_numbers_everywhere_and_no_wind_in_objects():
    found = solution().without_objects((BOX,)).filled()

    assert np.isfinite(found.temperature_k).all()
    assert found.velocity_m_s is not None
    assert found.velocity_m_s[3, 3, 1] == pytest.approx(0.0)
    assert found.velocity_m_s[0, 0, 0] == pytest.approx(1.0)


def test_a_result_without_objects_stays_the_same():
    given = solution()
    assert given.without_objects(()) is given
    assert given.filled() is given


@pytest.mark.parametrize("kind", [kind for kind, ready in READY.items() if ready.size_m])
def test_ready_objects_stand_on_their_foot(kind: str):
    item = ready_object(kind, "thing", (2.0, 1.5, 0.0))

    room = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 2.5))
    assert all(r <= i for r, i in zip(room.lower_m, item.lower_m, strict=True))
    assert item.size_m == pytest.approx(READY[kind].size_m)
    assert READY[kind].source


def test_an_unknown_ready_object_and_a_box_without_a_size_are_refused():
    with pytest.raises(SettingError, match="'crate' has no size"):
        ready_object("box", "crate", (0.0, 0.0, 0.0))
    with pytest.raises(SettingError, match="There is no ready object 'piano'"):
        ready_object("piano", "thing", (0.0, 0.0, 0.0))
