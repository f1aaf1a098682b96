"""The demo: what it tells, and that it takes nobody's folder."""

import pytest
from rich.console import Console

from app.commands.sketch import COLUMNS, LINES, sketch
from app.errors import BadInputError
from app.report.beside import places, rows
from app.simulate.demo import WORLD, run_demo
from app.simulate.worlds import LAB
from app.volume.sample import SAMPLE_ROOM
from core.objects import RoomObject
from core.significance import EITHER_WAY
from tests.app.report.test_indoor import OPENINGS, PLUG_ROOM, layered, replace


def test_a_folder_that_is_no_demo_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(BadInputError, match="not a demo"):
        run_demo(tmp_path, SAMPLE_ROOM)
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_its_pictures_are_a_labs_with_a_printed_frame():
    assert WORLD == replace(LAB, border="print", place="paper")
    assert WORLD.misreads


def test_places_have_their_values_and_intervals():
    found = places(layered(deviation=0.01), replace(PLUG_ROOM, boundary=OPENINGS))
    jet, middle, head, ankles = found
    assert jet.words == "1 m before the supply"
    assert jet.at_m[0] == pytest.approx(1.0)
    # 295 K at the floor, 2 K/m, and 0.05 K of deviation.
    assert middle.celsius == pytest.approx(295.0 + 2.0 - 273.15)
    assert middle.celsius_half == pytest.approx(EITHER_WAY * 0.05)
    assert head.celsius - ankles.celsius == pytest.approx(2.0)
    assert middle.speed_m_s == pytest.approx(0.1)
    # Along x alone: the deviation of the velocity along itself.
    assert middle.speed_half_m_s == pytest.approx(EITHER_WAY * 0.01)
    assert rows(found)[1][1] == "23.85 ± 0.10 °C"
    assert rows(found)[1][2] == "-"


def test_a_place_in_an_object_has_no_air_to_tell_of():
    table = RoomObject(name="table", lower_m=(1.5, 1.0, 0.5), upper_m=(2.5, 2.0, 1.5))
    solution = layered(deviation=0.01).without_objects((table,))
    told = rows(places(solution, replace(PLUG_ROOM, boundary=OPENINGS)))
    assert told[1][1:] == ("-", "-", "-", "-")
    assert told[2][1].endswith("°C")
    assert "nan" not in sketch(solution).plain


def test_the_sketch_is_warm_above_and_cold_below():
    drawn = sketch(layered())
    console = Console(width=100, force_terminal=True, color_system="truecolor")
    lines = console.render_lines(drawn)
    assert [sum(segment.cell_length for segment in line) for line in lines[:LINES]] == [100] * LINES
    top, bottom = drawn.spans[0].style.color.triplet, drawn.spans[COLUMNS * (LINES - 1)].style.bgcolor.triplet
    assert top.red > top.blue
    assert bottom.blue > bottom.red
    assert "21.9 °C (blue) to 25.9 °C (red)" in drawn.plain
