"""Boards on paper: found where their model says that their points are, to a twentieth of a millimetre."""

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import create_cli
from app.errors import BadInputError
from app.experiment.folder import create_experiment, open_experiment
from app.experiment.printed import read_printed
from app.experiment.rig_settings import BoardSettings
from app.sheets.board import board_layout, largest_square_m, print_board
from tests.app.files.test_toml import example
from tests.app.sheets.sheets import pictures_mm, texts


@pytest.mark.parametrize(
    ("kind", "columns", "rows", "square_m", "marker_m"),
    [
        ("charuco", 9, 6, 0.03, None),
        ("charuco", 7, 5, 0.0375, 0.028),
        ("chessboard", 8, 5, 0.035, None),
        ("asymmetric-circles", 4, 9, 0.05, None),
    ],
)
def test_a_scan_of_the_board_finds_its_points_true(tmp_path, kind, columns, rows, square_m, marker_m):
    settings = BoardSettings(kind=kind, columns=columns, rows=rows, square_m=square_m, marker_m=marker_m)
    path, record = print_board(settings, "a2", tmp_path / "board.pdf")
    assert record is None
    board = settings.board()
    ((place_mm, drawn),) = pictures_mm(path)
    # A detector knows no circle of a hundred pixels.
    scale = 0.4 if "circles" in kind else 1.0
    picture = cv2.resize(drawn, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    per_mm = np.array(picture.shape[::-1]) / (place_mm[2:] - place_mm[:2])
    found = board.detect(picture)
    assert found is not None
    expected_mm = 1e3 * board.points_m[found.ids, :2]
    assert len(found.ids) == len(board.points_m)
    # A detector may begin at another corner, and the sheet may lie across: distances are what must be true.
    seen_mm = found.pixels_px / per_mm
    between = np.linalg.norm(seen_mm[:, None] - seen_mm[None], axis=2)
    wrong_mm = between - np.linalg.norm(expected_mm[:, None] - expected_mm[None], axis=2)
    assert np.abs(wrong_mm).max() < 0.05
    assert abs(float(wrong_mm.mean())) < 0.005
    (text,) = texts(path)
    assert f"--grid {columns}x{rows} --square {1e3 * square_m:g}mm" in text
    assert "100 mm" in text


def run(*words):
    told = CliRunner().invoke(create_cli(), ["print", "board", *(str(word) for word in words)])
    if told.exception and not isinstance(told.exception, SystemExit):
        raise told.exception
    assert told.exit_code == 0, told.output
    return told.output


def test_a_printed_board_becomes_the_rigs_own_where_it_has_none(tmp_path):
    made = create_experiment(tmp_path / "wall", example())
    assert "It is the rig's board now" in run(made.folder, "--paper", "a2")
    board = open_experiment(made.folder).settings.rig.board
    assert board is not None
    assert board.square_m == largest_square_m(board, "a2") > 0.03
    record = read_printed(made, "board")
    assert record is not None
    assert record.content["square_m"] == board.square_m
    assert record.file == "print/board-a2.pdf"
    # Another one is printed when it is asked for, and the rig keeps its own.
    assert "now" not in run(made.folder, "--kind", "chessboard", "--grid", "8x5", "--square", "2cm")
    assert open_experiment(made.folder).settings.rig.board == board
    assert f"squares of {1e3 * board.square_m:g} mm" in run(made.folder, "--paper", "a1")


def test_a_board_needs_no_experiment(tmp_path):
    out = tmp_path / "b.pdf"
    assert str(out) in run("--kind", "charuco", "--grid", "7x5", "--paper", "a4", "--out", out)
    assert out.is_file()


def test_a_board_larger_than_the_paper_is_put_together_from_sheets(tmp_path):
    large = BoardSettings(kind="chessboard", columns=9, rows=6, square_m=0.1)
    path, record = print_board(large, "a3", experiment=create_experiment(tmp_path / "wall", example()))
    assert record is not None
    assert record.sheets == (3, 5)
    pages = pictures_mm(path)
    assert len(pages) == len(texts(path)) == 15
    assert (record.width_m, record.height_m) == pytest.approx((1.2, 0.9))
    px = round(large.square_m / record.print_pixel_m)
    whole = large.board().draw(px)
    seen = np.zeros(whole.shape, bool)
    for tile, (place_mm, part) in zip(board_layout(large, "a3").tiles, pages, strict=True):
        assert np.array_equal(part, whole[tile.rows, tile.cols])
        assert place_mm[2] - place_mm[0] == pytest.approx(
            1e3 * part.shape[1] * record.print_pixel_m, abs=0.01
        )
        seen[tile.rows, tile.cols] = True
    assert seen.all()
    assert "row 3 of 3 from the top, column 5 of 5 from the left" in texts(path)[-1]
    told = run("--kind", "chessboard", "--square", "10cm", "--out", tmp_path / "board.pdf")
    assert "15 sheets, 3 rows of 5. Print" in told


def test_a_board_of_too_many_sheets_is_refused_with_the_square_that_fits_one():
    large = BoardSettings(kind="chessboard", columns=9, rows=6, square_m=0.2)
    fits = BoardSettings(kind="chessboard", columns=9, rows=6, square_m=largest_square_m(large, "a4"))
    with pytest.raises(
        BadInputError, match=f"more than 40 sheets of a4.* squares may be {1e3 * fits.square_m:g} mm"
    ):
        print_board(large, "a4")
