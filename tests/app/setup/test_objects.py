"""People and furniture as answers: kinds have their size and heat, and what is told replaces it."""

import json
from typing import get_args

import pytest

from app.experiment.folder import open_experiment
from app.setup.answers import ObjectAnswer
from app.setup.experiment import new_experiment, read_answers, template
from app.setup.readback import answer_of
from app.setup.scene import object_of, settings_of
from core.objects import READY, RoomObject

PEOPLE = """
[[object]]
kind = "seated_person"
position = ["1 m", "1.5 m", "0 m"]
[[object]]
kind = "seated_person"
position = ["3 m", "1.5 m", "0 m"]
heat = "60 W"
heat_deviation = "5 W"
[[object]]
kind = "box"
position = ["2 m", "1.5 m", "0.2 m"]
size = ["0.6 m", "40 cm", "0.5 m"]
[[object]]
kind = "cabinet"
position = ["2 m", "0.5 m", "0 m"]
temperature = "24 C"
"""


def test_a_kind_has_its_heat_and_what_is_told_replaces_it():
    answers = read_answers(template("wall-jet") + PEOPLE, "answers.toml")

    first, second, box, cabinet = settings_of(answers, (10.0, 0.0, 0.0)).scene.objects

    assert (first.thermal, first.power_w, first.power_std_w) == ("power", 75.0, 20.0)
    assert (second.power_w, second.power_std_w) == (60.0, 5.0)
    assert (box.thermal, box.size_m) == ("adiabatic", pytest.approx((0.6, 0.4, 0.5)))
    assert box.lower_m == pytest.approx((11.7, 1.3, 0.2))
    assert (cabinet.thermal, cabinet.temperature_k, cabinet.power_w) == ("temperature", 297.15, None)
    assert len({item.name for item in (first, second, box, cabinet)}) == 4


def test_an_experiment_made_from_answers_keeps_its_people(tmp_path):
    new_experiment(tmp_path / "lab", template("wall-jet") + PEOPLE, "answers.toml")

    kept = open_experiment(tmp_path / "lab").settings.scene.objects

    assert [item.name for item in kept] == ["seated person 1", "seated person 2", "box 3", "cabinet 4"]


def test_every_kind_is_offered():
    assert set(get_args(ObjectAnswer.model_fields["kind"].annotation)) == set(READY)


def test_a_box_that_was_found_is_answered_from_the_rooms_corner():
    box = RoomObject(name="found 1", lower_m=(0.706, 1.068, 0.0), upper_m=(1.138, 1.5, 1.208))
    corner_m = (-1.2, -1.5, 0.0)

    answer = ObjectAnswer.model_validate_json(json.dumps(answer_of(box, corner_m)))
    made = object_of(answer, 0, corner_m)

    assert answer.position == pytest.approx((2.122, 2.784, 0.0))
    assert made.thermal == "adiabatic"
    assert made.lower_m == pytest.approx(box.lower_m, abs=1e-9)
    # It touches the back wall and does not reach into it.
    assert made.upper_m == pytest.approx(box.upper_m, abs=1e-9)
