"""A wrong file is told by line and column, and one mistake is one sentence."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import app
from app.errors import BadInputError
from app.experiment.folder import ExperimentSettings
from app.files.toml import from_toml, read_toml
from app.files.toml_places import places_of
from app.setup.answers import Answers

GOOD = """# a room
title = "a room"

[rig.camera]
kind = "v4l2"
width_px = 100
height_px = 80
exposure_s = 0.02

[scene]
room.lower_m = [0.0, 0.0, 0.0]
room.upper_m = [
  4.0,   # along x
  3.0,
  2.7,
]
air = { pressure_pa = 101325.0, ambient_temperature_k = 293.15 }
light = { kind = "texture", pixel_m = 0.001 }

[[scene.views]]
name = "left # of two"
[scene.views.camera]
width_px = 100
height_px = 80
focal_px = [700.0, 700.0]
principal_px = [50.0, 40.0]
position_m = [2.0, -5.0, 1.3]
rotation_rad = [1.57, 0.0, 0.0]

[[scene.boundary]]
kind = "wall"
wall = "z_min"

[[scene.boundary]]
kind = "inlet"
temperature_k = 300.0
velocity_m_s = [0.5, 0.0, 0.0]
  [scene.boundary.patch]
  wall = "x_min"
  lower_m = [1.0, 1.0]
  upper_m = [2.0, 2.0]

[scene.solve]
"grid" = 32
"""

# What is written instead of a line, and where it is then said to be wrong: the place, and words.
WRONG = {
    "an unknown key at the top": (
        'title = "a room"',
        'titel = "a room"',
        (2, 1),
        "'titel'; did you mean 'title'",
    ),
    "an unknown key in a table": ("exposure_s", "exposure", (8, 1), "did you mean 'exposure_s'"),
    "an unknown key of an inline table": (
        "{ pressure_pa",
        "{ presure_pa",
        (17, 9),
        "did you mean 'pressure_pa'",
    ),
    "an unknown key of the second table of an array": (
        "temperature_k = 300.0",
        "temprature_k = 300.0",
        (36, 1),
        "unknown key 'scene.boundary.1.temprature_k'",
    ),
    "an unknown table": ("[scene.solve]", "[scene.solv]", (43, 1), "did you mean 'solve'"),
    "text for a number": (
        "width_px = 100\nheight_px = 80\nexp",
        'width_px = "100"\nheight_px = 80\nexp',
        (6, 12),
        "integer",
    ),
    "a number for text": ('name = "left # of two"', "name =   7", (21, 10), "scene.views.0.name"),
    "one item of a list": ("  3.0,", '  "3",', (14, 3), "scene.room.upper_m.1"),
    "too few items": (
        "principal_px = [50.0, 40.0]",
        "principal_px = [50.0]",
        (26, 1),
        "principal_px.1: it is missing",
    ),
    "a key that is missing": (
        '  wall = "x_min"\n',
        "",
        (38, 3),
        "scene.boundary.1.patch.wall: it is missing",
    ),
    "degrees for kelvin": ("= 293.15", "= 20.0", (17, 57), "20 degrees Celsius"),
    "Celsius in a table of an array": (
        "temperature_k = 300.0",
        "temperature_k = 27.0",
        (36, 17),
        "20 degrees Celsius",
    ),
    "a wrong member of a union": (
        'kind = "wall"',
        'kind = "wal"',
        (31, 8),
        "'wal' is not known; expected one of",
    ),
    "no member of a union": (
        'kind = "inlet"\ntemperature_k = 300.0',
        'temperature_k = "warm"',
        (34, 1),
        "it is missing; expected one of 'plane_field', 'inlet'",
    ),
    "a wrong member of an inline table": (
        'kind = "texture"',
        'kind = "textur"',
        (18, 18),
        "'texture', 'projector'; did",
    ),
    "a wrong device": ('kind = "v4l2"', 'kind = "usb"', (5, 8), "expected one of 'simulated', 'v4l2'"),
    "a number that may be a word": (
        '"grid" = 32',
        '"grid" = "fine"',
        (44, 10),
        "scene.solve.grid: Input should be",
    ),
    "no TOML": ("[scene.solve]", "[scene.solve", (43, 13), "not valid TOML"),
}


def test_the_good_file_is_good():
    assert from_toml(GOOD, ExperimentSettings, "x").scene.solve.grid == 32


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_told_at_its_line_and_column_in_one_sentence(case, tmp_path):
    old, new, (line, column), words = WRONG[case]
    assert GOOD.count(old) == 1
    path = tmp_path / "experiment.toml"
    path.write_text(GOOD.replace(old, new), encoding="utf-8")
    with pytest.raises(BadInputError) as caught:
        read_toml(path, ExperimentSettings)
    said = str(caught.value)
    assert said.startswith(f"{path}, line {line}, column {column}: "), said
    assert words in said
    # One mistake, one sentence: nothing of the members of a union that were not meant.
    if "missing" not in said and case != "an unknown key of the second table of an array":
        assert said.count(": ") <= 3, said
    assert "it is missing; give it" not in said or case in ("too few items", "a key that is missing"), said


def test_two_mistakes_are_told_in_the_order_of_the_file():
    text = GOOD.replace('"a room"', "1").replace("300.0", "20.0")
    with pytest.raises(
        BadInputError, match=r"^x, line 2, column 9: title: .*; line 36, column 17: scene\.boundary\.1"
    ):
        from_toml(text, ExperimentSettings, "x")


def test_answers_are_told_at_their_place_too():
    text = (Path(app.__file__).parent / "setup" / "templates" / "wall-jet.toml").read_text(encoding="utf-8")
    line = text[: text.index('flow = "120 m3/h"')].count("\n") + 1
    with pytest.raises(
        BadInputError, match=rf"^answers\.toml, line {line}, column 8: supply\.0\.flow: .*no unit"
    ):
        from_toml(text.replace('"120 m3/h"', '"120"'), Answers, "answers.toml")


def paths(data, above=()):
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*above, key)
        yield from paths(value, (*above, key))


ODD = '''
"a.b" = 1 # "x" = 2
'lit' . c = """two
"quoted" [lines] \\""" = 3"""
d.e.f = [[1, 2], ["]", '#'], { g = 1, h.i = [ { j = 2 } ] }]
k = \'\'\'raw
'' [x] = 1\'\'\'
l = 1979-05-27 07:32:00
m = ""
n = {}
o = []
[p . "q r"]
s = -inf
[[t]]
u = 1
[[t.v]]
[t.v.w]
x = true
[[t.v]]
y = "\\\\"
[[t]]
[t.z]
'''


@pytest.mark.parametrize("text", [GOOD, ODD, ODD.replace("\n", "\r\n").replace("two\r\n", "two\n")])
def test_every_key_of_any_toml_is_found(text):
    data, places = tomllib.loads(text), places_of(text)
    assert set(paths(data)) == set(places)
    lines = text.split("\n")
    for path, place in places.items():
        line, column = place.key
        assert 1 <= column <= len(lines[line - 1]) + 1
        if isinstance(path[-1], str):
            start = lines[line - 1][column - 1 :]
            assert start[0] == "[" or any(str(part)[0] in start[:2] for part in path if isinstance(part, str))


def test_every_template_is_found_whole():
    for path in (Path(app.__file__).parent / "setup" / "templates").glob("*.toml"):
        text = path.read_text(encoding="utf-8")
        assert set(paths(tomllib.loads(text))) == set(places_of(text))


@given(st.text(alphabet="ab.[]{}=\"'#,\n 1\\", max_size=60))
def test_what_is_no_toml_has_no_end_of_the_world(text):
    places_of(text)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    assert set(paths(data)) == set(places_of(text))
