"""Wrong entries, each with its sentence at its field, at both doors: the file and the service."""

import copy
import re
import tomllib
from typing import Any

import pytest

from app.api.models.answers import SentAnswers
from app.api.resources.answers import check_answers
from app.errors import BadInputError
from app.files.toml import to_toml
from app.files.toml_places import nearest, places_of
from app.setup.experiment import new_experiment, template
from app.setup.mistakes import mistakes_in

GONE = object()
BESIDE = [{"wall": "x_min", "lower": ["1.5 m", "2.4 m"], "upper": ["2 m", "2.6 m"], "temperature": "40 C"}]
OUTLET = {"wall": "x_max", "lower": ["1.2 m", "0.1 m"], "upper": ["1.8 m", "0.3 m"]}
PERSON = {"kind": "seated_person", "position": ["2 m", "1 m", "0 m"]}
METER = {"position": ["2 m", "1 m", "1 m"], "velocity": ["0.1 m/s", "0 m/s", "0 m/s"]}
PROJECTOR = {
    "position": ["3 m", "-1 m", "1 m"],
    "width_px": 1920,
    "height_px": 1200,
    "angle_of_view": "40 deg",
}
Keys = tuple[str | int, ...]

# What is changed in the jet's template (keys, wrong value), the field that tells it, and what it says there.
WRONG: list[tuple[Keys, Any, str, str]] = [
    # Units.
    (("room", 0), "4000 m", "room[0]", r"'4000 m' is out of range.*millimetres \(4000 mm\)"),
    (("room", 2), "27", "room[2]", r"'27' has no unit; expected a number and its unit \(m, cm"),
    (("room", 1), "3 l", "room[1]", r"'l' is no unit of length"),
    (("room", 1), "3 cm", "room[1]", r"A room is 0.1 to 100 m long"),
    (("air",), "20 K", "air", r"'20 K' is out of range.*is the unit right"),
    (("air",), "293 C", "air", r"'293 C' looks like kelvin: write 293 K for 19.85 C"),
    (("air",), "20", "air", r"has no unit"),
    (("air",), 293.15, "air", r"in quotes"),
    (("air",), "warm", "air", r"'warm' is no temperature; expected a number"),
    (("supply", 0, "temperature"), "26 K", "supply[0].temperature", r"out of range"),
    (("supply", 0, "temperature"), "299 C", "supply[0].temperature", r"write 299 K for 25.85 C"),
    (("outlet", 0, "temperature"), "22,4 C", "outlet[0].temperature", r"has a comma; write '22.4 C'"),
    (("room", 1), "", "room[1]", r"it is empty; expected a number and its unit \(m, cm.*'2.7 m'\.$"),
    (("supply", 0, "upper", 0), "200 m", "supply[0].upper[0]", r"not on x_min.*millimetres \(200 mm\)"),
    (("supply", 0, "upper", 0), "1800 m", "supply[0].upper[0]", r"millimetres"),
    (("supply", 0, "flow"), "120 m3", "supply[0].flow", r"'m3' is no unit of volume flow.*m3/h"),
    (("supply", 0, "flow"), "120 m3/s", "supply[0].flow", r"1e\+03 m/s; .*slower than 50 m/s"),
    (("supply", 0, "flow"), "-5 m3/h", "supply[0].flow", r"out of range"),
    (("supply", 0, "deviation"), "5", "supply[0].deviation", r"has no unit"),
    (("supply", 0, "deviation"), "500 %", "supply[0].deviation", r"0.01 to 100 %"),
    (("camera", "exposure"), "20 m", "camera.exposure", r"'m' is no unit of time"),
    (("camera", "exposure"), "500 s", "camera.exposure", r"60 s"),
    (("camera", "focal_length"), "10", "camera.focal_length", r"has no unit"),
    (("camera", "distance"), "0 m", "camera.distance", r"above zero"),
    # Lenses.
    (("camera", "pixel_pitch"), "5.86 mm", "camera.pixel_pitch", r"5860 um .* of 10 mm see 180 degrees"),
    (
        ("camera", "focal_length"),
        "400 m",
        "camera.focal_length",
        r"400000 mm see 0.00161 degrees.*units right",
    ),
    # Places.
    (("supply", 0, "upper", 1), "2.9 m", "supply[0].upper[1]", r"2.3 to 2.9 m along z is not on x_min"),
    (("supply", 0, "lower", 0), "-0.2 m", "supply[0].lower[0]", r"-0.2 to 1.8 m along y is not on x_min"),
    (("supply", 0, "upper", 0), "1 m", "supply[0].upper[0]", r"lower is 1.2 m and upper 1 m along y"),
    (("supply", 0, "wall"), "left", "supply[0].wall", r"x_min"),
    (("surface",), BESIDE, "surface[0]", r"it overlaps supply 1 on x_min.*move one of them"),
    (("thermometer", 0, "position", 2), "11 m", "thermometer[0].position[2]", r"11 m along z is outside"),
    (("thermometer", 0, "position", 0), "-1 m", "thermometer[0].position[0]", r"outside the room"),
    (("thermometer", 0, "position", 1), "150 m", "thermometer[0].position[1]", r"millimetres \(150 mm\)"),
    (
        ("anemometer",),
        [METER | {"position": ["2 m", "4 m", "1 m"]}],
        "anemometer[0].position[1]",
        r"4 m along y",
    ),
    (
        ("projector",),
        PROJECTOR | {"position": ["3 m", "3 m", "1 m"]},
        "projector.position[1]",
        r"at or behind",
    ),
    # Objects.
    (("object",), [PERSON | {"kind": "piano"}], "object[0].kind", r"'box', 'seated_person'"),
    (("object",), [PERSON | {"kind": "box"}], "object[0]", r"a box has a size"),
    (("object",), [PERSON | {"heat": "75"}], "object[0].heat", r"has no unit.*W, kW"),
    (("object",), [PERSON | {"heat": "75 W", "temperature": "30 C"}], "object[0]", r"heat or temperature"),
    (
        ("object",),
        [PERSON | {"position": ["0.1 m", "1 m", "0 m"]}],
        "object[0].position[0]",
        r"reaches from -0.1 to 0.3 m along x; the room is 0 to",
    ),
    (("object",), [PERSON, PERSON], "object[1]", r"it stands in object 1"),
    (
        ("object",),
        [PERSON | {"size": ["0.4 m", "0.4 m", "12 m"]}],
        "object[0].size[2]",
        r"it is 12 m long along z, more than the room's",
    ),
    (("title",), "n" * 201, "title", r"at most 200"),
    # What contradicts itself.
    (("outlet",), GONE, "supply", r"1 supplies and 0 outlets: air that comes in must leave"),
    (("supply",), GONE, "outlet", r"0 supplies and 1 outlets"),
    (
        ("outlet",),
        [OUTLET | {"flow": "120 m3/h"}, OUTLET | {"wall": "x_min"}],
        "outlet[1].flow",
        r"the other outlets take 120 m3/h and the supplies bring 120 m3/h, so nothing is left for this one",
    ),
    (("supply", 0, "speed"), "1 m/s", "supply[0]", r"give flow or speed, and not both"),
    (("supply", 0, "flow"), GONE, "supply[0]", r"give flow or speed"),
    (("camera", "distance"), GONE, "camera", r"give distance .* or position"),
    (("wall",), [{"wall": "z_max", "adiabatic": True}] * 2, "wall[1].wall", r"z_max is answered twice"),
    (("wall",), [{"wall": "z_max"}], "wall[0]", r"temperature or adiabatic = true"),
    (("camera", "kind"), "usb", "camera.kind", r"v4l2"),
    (("camera", "width_px"), 3, "camera.width_px", r"16"),
    (("camera", "bits"), 40, "camera.bits", r"16"),
    (("supply", 0, "wal"), "x_min", "supply[0].wal", r"unknown key .*wal'; did you mean 'wall'"),
    (("supply", 0, "temperature"), GONE, "supply[0].temperature", r"it is missing"),
]


def changed(keys: Keys, value: Any) -> dict[str, Any]:
    data = copy.deepcopy(tomllib.loads(template("wall-jet")))
    at: Any = data
    for key in keys[:-1]:
        at = at[key]
    if value is GONE:
        del at[keys[-1]]
    else:
        at[keys[-1]] = value
    return data


def test_there_are_forty_at_least():
    assert len({(keys, str(value)) for keys, value, _, _ in WRONG}) >= 40


@pytest.mark.parametrize(("keys", "value", "field", "sentence"), WRONG)
def test_a_wrong_entry_is_told_at_its_field_by_the_service(keys, value, field, sentence):
    told = check_answers(None, SentAnswers(answers=changed(keys, value)))
    assert [one.field for one in told.mistakes] == [field]
    assert re.search(sentence, told.mistakes[0].sentence)
    assert told.told is None


@pytest.mark.parametrize(("keys", "value", "field", "sentence"), WRONG)
def test_a_wrong_entry_is_told_at_its_line_in_a_file(keys, value, field, sentence, tmp_path):
    text = to_toml(changed(keys, value))
    with pytest.raises(BadInputError, match=sentence) as told:
        new_experiment(tmp_path / "lab", text, "answers.toml")
    path = tuple(int(part) if part.isdigit() else part for part in re.findall(r"\w+", field))
    found = nearest(places_of(text), path)
    assert found is not None
    line = int(re.match(r"answers.toml, line (\d+), column \d+: ", str(told.value))[1])
    # A sentence about a whole table stands at the key of it that the sentence names.
    assert line >= found[1].key[0]
    assert line == found[1].key[0] or isinstance(path[-1], int) or path == ("camera",)
    assert not (tmp_path / "lab").exists()


def test_every_mistake_is_told_and_one_slip_is_told_once():
    data = changed(("air",), "20 K")
    data["supply"][0]["flow"] = "120"
    data["thermometer"][0]["position"][2] = "11 m"
    data["surface"] = [BESIDE[0] | {"wall": "x_max", "lower": ["1.2 m", "0.2 m"], "upper": ["1.4 m", "1 m"]}]
    fields = [one.path for one in mistakes_in(data)]
    # The supply with the wrong flow counts as a supply still.
    assert fields == [
        ("air",),
        ("supply", 0, "flow"),
        ("surface", 0),
        ("thermometer", 0, "position", 2),
    ]
