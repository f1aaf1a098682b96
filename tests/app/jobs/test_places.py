"""The kind `places`: answers are checked before anything is computed, and the map counts from the room's corner."""

import pytest

from app.errors import BadInputError
from app.files.toml import toml_data
from app.jobs.kinds.places import read
from app.plan.make import places_of
from app.setup.experiment import read_answers, template
from app.setup.scene import settings_of


def test_wrong_answers_are_refused_with_their_field():
    answers = toml_data(template("wall-jet"), "wall-jet")
    assert read({"answers": answers}).answers == answers
    with pytest.raises(BadInputError, match=r"room\[0\]: .*millimetres"):
        read({"answers": answers | {"room": ["4000 m", "3 m", "2.7 m"]}})
    with pytest.raises(BadInputError, match="answer"):
        read({})


def test_the_map_counts_from_the_rooms_corner_and_a_nearer_camera_sees_less_of_the_wall():
    found = places_of(settings_of(read_answers(template("empty"), "empty")).scene)
    assert (found.lower_m, found.upper_m) == ([0.0, 0.0], [4.0, 3.0])
    assert found.camera_m == pytest.approx([2.0, -1.0, 1.35])
    shares = [[share or 0.0 for share in row] for row in found.wall_share]
    nearest, farthest = found.y_m.index(max(found.y_m)), found.y_m.index(min(found.y_m))
    middle = len(found.x_m) // 2
    assert 0 < shares[nearest][middle] < shares[farthest][middle]
