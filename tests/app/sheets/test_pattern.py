"""Sheets of the pattern: true to scale, whole when put together, and seen by the camera as the simulator sees it."""

import itertools
import tracemalloc
from dataclasses import replace

import numpy as np
import pypdfium2
import pytest
from typer.testing import CliRunner

from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.folder import create_experiment, open_experiment, save_settings
from app.experiment.printed import is_of_the_scene, read_printed
from app.files.provenance import sha256
from app.rig.practice_room import FACING
from app.sheets.paper import FOOTER_M, MARGIN_M, laid_out, papers_of
from app.sheets.pattern import print_pattern, print_pattern_of
from calibration.simulated_pictures import Sheet, look
from core.displacement import measure_shift
from core.geometry import Box, looking_along_y
from core.pattern import make_pattern
from core.plan.print_choice import finest_period, suited_print
from core.render import render_reference
from core.scene import CheckerPattern, DotPattern, FixedTexture, ProjectedPattern, WaveletPattern
from tests.app.files.test_toml import example
from tests.app.sheets.sheets import lines_mm, pictures_mm, texts

CAMERA = looking_along_y(position_m=(0.55, -2.0, 0.4), width_px=320, height_px=240, focal_px=600.0)
ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(1.1, 0.5, 0.8))


def experiment(folder, light=None):
    settings = example()
    scene = settings.scene
    views = (replace(scene.views[0], camera=CAMERA),)
    light = light or suited_print(CAMERA, 2.5, 7)
    scene = replace(scene, room=ROOM, views=views, light=light, boundary=())
    return create_experiment(folder, settings.model_copy(update={"scene": scene}))


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    made = experiment(tmp_path_factory.mktemp("printed") / "wall")
    path, record = print_pattern(made, "a4")
    return made, path, record


def put_together(path, record):
    """All sheets' pictures by their overlaps, as somebody glues them: (rows, cols); overlaps must agree."""
    rows, cols = (round(size / record.print_pixel_m) for size in (record.height_m, record.width_m))
    whole = np.full((rows, cols), -1, int)
    pictures = [picture for _, picture in pictures_mm(path)]
    down, across = record.sheets
    height, width = pictures[0].shape
    for number, picture in enumerate(pictures):
        row, col = divmod(number, across)
        top = round(row * (rows - height) / max(down - 1, 1))
        left = round(col * (cols - width) / max(across - 1, 1))
        there = whole[top : top + height, left : left + width]
        assert np.all((there == -1) | (there == picture))
        whole[top : top + height, left : left + width] = picture
    assert whole.min() >= 0
    return whole.astype(np.uint8)


def test_a_ruler_finds_the_bar_and_the_pixels_true(printed):
    _, path, record = printed
    for page, (place_mm, picture) in zip(pypdfium2.PdfDocument(path), pictures_mm(path), strict=True):
        level = [line for line in lines_mm(page) if line[1] == line[3]]
        longest = max(level, key=lambda line: line[2] - line[0])
        assert longest[2] - longest[0] == pytest.approx(100.0, abs=0.01)
        pitch_mm = np.array([place_mm[2] - place_mm[0], place_mm[3] - place_mm[1]]) / picture.shape[::-1]
        # True over the whole sheet, not only over one pixel.
        wrong_mm = (pitch_mm - 1e3 * record.print_pixel_m) * picture.shape[::-1]
        assert np.abs(wrong_mm).max() < 0.05
        assert (page.get_width() * 25.4 / 72, page.get_height() * 25.4 / 72) == pytest.approx(
            (210, 297), abs=0.01
        ) or (
            page.get_width() * 25.4 / 72,
            page.get_height() * 25.4 / 72,
        ) == pytest.approx((297, 210), abs=0.01)


def test_sheets_put_together_are_the_whole_pattern(printed):
    made, path, record = printed
    pattern = print_pattern_of(made.settings.scene)
    whole = put_together(path, record)
    np.testing.assert_array_equal(whole, pattern.picture(*(slice(0, n) for n in pattern.size_px)))
    # Read where the scene's own pixels are, it is the scene's own pattern, and nothing of this module.
    light, fine = made.settings.scene.light, pattern.fine
    assert fine == 5
    own = make_pattern(light.pattern, pattern.rows, pattern.cols)
    middle = whole[fine // 2 :: fine, fine // 2 :: fine] / 255
    assert np.abs(middle - own)[1:-1, 1:-1].max() < 0.003


def test_overlaps_are_marked_where_the_next_picture_ends(printed):
    _, path, record = printed
    first = pypdfium2.PdfDocument(path)[0]
    (left, _, right, _), _ = pictures_mm(path)[0]
    upright = {round(line[0], 2) for line in lines_mm(first) if line[0] == line[2] and line[1] > 100}
    assert round(left, 2) in upright
    assert round(right, 2) in upright
    inner = [x for x in upright if left + 1 < x < right - 1]
    assert len(inner) == 1
    assert 10.0 <= right - inner[0] < 10.0 + 2e3 * record.print_pixel_m


def test_the_camera_sees_the_printed_sheets_where_the_simulator_sees_the_pattern(printed):
    made, path, record = printed
    scene = made.settings.scene
    whole = put_together(path, record)
    corner = np.array([ROOM.lower_m[0], ROOM.upper_m[1], ROOM.upper_m[2]])
    paper = Sheet(whole, 1 / record.print_pixel_m, corner, FACING)
    photographed = look(CAMERA, (paper,), samples=3).expose(None, 1.0)
    expected = render_reference(scene)
    inside = (slice(48, 192), slice(64, 256))
    shift = measure_shift(expected[inside], photographed[inside], 1e-4, 16).displacement_px
    assert np.abs(shift).max() < 0.1
    assert np.abs(shift.mean(axis=0)).max() < 0.01


def test_the_footer_and_the_experiment_say_what_was_printed(printed):
    made, path, record = printed
    rows, cols = record.sheets
    assert rows * cols > 4
    for number, text in enumerate(texts(path)):
        assert "seed 7" in text
        assert "1:1" in text
        assert "airlens" in text
        assert f"Row {number // cols + 1} of {rows}" in text
        assert f"column {number % cols + 1} of {cols}" in text
    assert read_printed(made, "pattern") == record
    assert record.sha256 == sha256(path)
    assert record.content["pattern"]["seed"] == 7
    assert record.finest_period_camera_px == pytest.approx(5.0)
    assert is_of_the_scene(record, made)


@pytest.mark.parametrize("light", [DotPattern(diameter_px=6.0), CheckerPattern(square_px=6.0)])
def test_dots_and_squares_are_printed_too(tmp_path, light):
    made = experiment(tmp_path / "wall", FixedTexture(pattern=light, pixel_m=0.002))
    path, record = print_pattern(made, "a1")
    whole, scene = put_together(path, record), made.settings.scene
    rows, cols = (n // 4 for n in whole.shape)
    assert scene.light.pixel_m == pytest.approx(4 * record.print_pixel_m)
    # Four by four print pixels to a pattern pixel, rounded where the renderer rounds between pixels.
    mean = whole.reshape(rows, 4, cols, 4).mean(axis=(1, 3)) / 255
    assert np.corrcoef(mean.ravel(), make_pattern(light, rows, cols).ravel())[0, 1] > 0.98


def test_what_is_too_fine_is_refused_and_chosen_on_demand(tmp_path):
    made = experiment(tmp_path / "wall", FixedTexture(pattern=WaveletPattern(seed=9, finest_px=3.0)))
    with pytest.raises(BadInputError, match=r"0\.72 pixels.*expected 5.*pixel_m = 0\.00694"):
        print_pattern(made, "a3")
    told = CliRunner().invoke(
        create_cli(), ["print", "pattern", str(made.folder), "--paper", "a0", "--choose"]
    )
    assert told.exit_code == 0, told.output
    light = open_experiment(made.folder).settings.scene.light
    assert light == suited_print(CAMERA, 2.5, 9)
    assert finest_period(light, made.settings.scene).holds
    assert not finest_period(made.settings.scene.light, made.settings.scene).holds
    assert (made.folder / "print" / "pattern-a0.pdf").is_file()


def test_a_roll_is_cut_to_the_wall(tmp_path):
    made = experiment(tmp_path / "wall")
    path, record = print_pattern(made, "610mm")
    assert record.sheets == (1, 2)
    page = pypdfium2.PdfDocument(path)[0]
    assert page.get_width() * 25.4 / 72 == pytest.approx(610, abs=0.01)
    assert page.get_height() * 25.4 / 72 == pytest.approx(
        1e3 * (record.height_m + MARGIN_M + FOOTER_M), abs=0.01
    )


@pytest.mark.parametrize(
    ("paper", "overlap_m", "words"),
    [
        ("a7", 0.01, "a4, a3"),
        ("5mm", 0.01, "200 to 3300 mm"),
        ("letter", 0.01, "rolls"),
        ("a4", 0.2, "overlap"),
        ("a4", -0.01, "overlap"),
    ],
)
def test_wrong_paper_is_refused(paper, overlap_m, words):
    with pytest.raises(BadInputError, match=words):
        laid_out(2000, 3000, 0.0005, paper, overlap_m)


@pytest.mark.parametrize("paper", ["a4", "a3", "a0", "841mm"])
@pytest.mark.parametrize("size", [(1, 1), (390, 591), (5000, 8000), (5001, 331)])
def test_any_layout_covers_the_picture_with_the_overlap_asked_for(paper, size):
    layout = laid_out(*size, 0.0005, paper, 0.0101)
    down, across = layout.sheets
    assert len(layout.tiles) == down * across
    for axis, total in enumerate(size):
        spans = sorted({((t.rows, t.cols)[axis].start, (t.rows, t.cols)[axis].stop) for t in layout.tiles})
        assert spans[0][0] == 0
        assert spans[-1][1] == total
        assert all(b[0] + 21 <= a[1] for a, b in itertools.pairwise(spans))
    room_m = max(one.area_m for one in papers_of(paper))
    assert max(layout.paper.width_m, layout.paper.height_m) <= max(room_m) + MARGIN_M * 2 + FOOTER_M


def test_a_projected_pattern_is_not_printed(tmp_path):
    scene = replace(example().scene, light=ProjectedPattern(projector=CAMERA))
    with pytest.raises(BadInputError, match="projector: there is nothing to print"):
        print_pattern_of(scene)


def test_a_large_wall_needs_the_memory_of_a_sheet(tmp_path):
    pattern = WaveletPattern(finest_px=10.0)
    camera = replace(CAMERA, focal_px=(2500.0, 2500.0))
    made = experiment(tmp_path / "wall")
    scene = replace(
        made.settings.scene,
        room=Box(lower_m=(-2.0, 0.0, -1.0), upper_m=(2.0, 0.5, 1.7)),
        views=(replace(made.settings.scene.views[0], camera=camera),),
        light=FixedTexture(pattern=pattern, pixel_m=0.0005),
    )
    large = save_settings(made.folder, made.settings.model_copy(update={"scene": scene}))
    tracemalloc.start()
    _, record = print_pattern(large, "a2")
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    pixels = record.width_m * record.height_m / record.print_pixel_m**2
    assert pixels > 4e7
    assert most < 8 * pixels
