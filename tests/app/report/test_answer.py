"""What the report's answer claims, and what it leaves open."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from app.experiment.captures import newest_pair
from app.experiment.folder import Experiment, ExperimentSettings
from app.experiment.rig_settings import RigSettings, SimulatedCameraSettings
from app.reconstruct.agreement import rendered_agreement
from app.report.answer import summary, ventilates
from app.report.doubts import doubts
from app.report.finding import Finding
from app.report.indoor import Quantity
from tests.app.reconstruct.test_problem import captured
from tests.app.report.test_indoor import OPENINGS, PLUG_ROOM, layered


@pytest.mark.parametrize(
    ("value", "low", "high", "words"),
    [
        (60.0, 52.0, 68.0, "better than"),
        (56.0, 35.0, 74.0, "as far as can be told"),
        (40.0, 31.0, 49.0, "worse than"),
        (60.0, None, None, "better than"),
        (50.0, None, None, "as far as can be told"),
    ],
)
def test_a_room_is_compared_with_a_mixed_one_only_where_its_interval_says_so(value, low, high, words):
    told = ventilates(Quantity("efficiency", "air change efficiency", "%", value, low, high))
    assert words in told
    assert "mixed: 50 %" in told


def test_each_category_says_of_what_it_is():
    scene = replace(PLUG_ROOM, boundary=OPENINGS)
    solution = layered(deviation=0.01)
    settings = ExperimentSettings(rig=RigSettings(camera=SimulatedCameraSettings()), scene=scene)
    experiment = Experiment(Path("nowhere"), settings)
    found = Finding(experiment, "one", {}, solution, tuple, lambda: pytest.fail("it needs no pictures"))
    people = summary(found)[0]
    assert re.search(
        r"people find it .* are dissatisfied\), .*(category|worse).* of ISO 7730 for warmth, and", people
    )
    assert people.endswith("category A to B for draught.")


def test_a_pattern_that_is_not_the_scenes_is_told_before_the_answer(tmp_path):
    experiment = captured(tmp_path / "one", "displacement")
    mirrored = rendered_agreement(experiment.settings.scene, newest_pair(experiment).reference)
    assert doubts(["nothing", mirrored]) == (mirrored,)
