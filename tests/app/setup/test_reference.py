"""The reference of experiment.toml: whole, and the one that the models make."""

from pathlib import Path

import pytest

import app
from app.experiment.folder import ExperimentSettings
from app.setup.answers import Answers
from app.setup.reference import meanings, reference, tables
from app.setup.units import Written

COMMITTED = Path(app.__file__).parent / "experiment" / "REFERENCE.md"


def test_the_committed_reference_is_the_one_that_the_models_make():
    told = "Make it again: airlens schema --markdown > app/experiment/REFERENCE.md"
    assert COMMITTED.read_text(encoding="utf-8") == reference(), told


@pytest.mark.parametrize("kind", [ExperimentSettings, Answers])
def test_every_key_has_its_meaning(kind):
    for table in tables(kind):
        bare = {name for name, meaning in meanings(table.kind).items() if not meaning}
        assert bare <= {"kind"}, table.kind


@pytest.mark.parametrize(
    "line",
    [
        "| `frame_rate_hz` | Frames a second, at most. | Hz | above 0 to 10000 | `30` | `30` |",
        "| `temperature_k` | Its temperature. | K | 150 to 5000 |  | `299.15` |",
        '| `pixel_pitch` | From one pixel of the sensor to the next. | length | 1e-07 to 500 m | - | `"5.86 um"` |',
        '| `steps` | Steps along a ray. |  | `"auto"`, 1 to 16384 | `"auto"` | `"auto"` |',
        "| `bands` | Octaves. |  | 1 to 12 | `4` | `4` |",
    ],
)
def test_a_row_tells_unit_range_default_and_example(line):
    assert line in reference()


def test_a_required_key_has_an_example():
    for row in reference().splitlines():
        cells = [cell.strip() for cell in row.split(" | ")]
        if row.startswith("| `") and cells[-2] == "":
            assert cells[-1] != "- |", row


def test_a_value_is_told_in_the_first_of_its_units():
    assert Written("temperature", 200.0, 800.0, "").range_text == "-73.15 to 526.9 C"
    assert Written("share", 1e-4, 1.0, "").text(0.05) == "5 %"
