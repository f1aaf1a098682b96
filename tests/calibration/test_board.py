import dataclasses
from typing import get_args

import numpy as np
import pytest

from calibration.board import CharucoBoard, Chessboard, CircleGrid, board_of, fixes_pose
from calibration.board_kind import BoardKind
from calibration.errors import CalibrationError
from calibration.simulated_pictures import look
from calibration.views import view_of
from tests.calibration.practice import exposed, project, rig, standing

# Board point 0 is this many squares from the corner of the print.
BOARDS = (
    (Chessboard(9, 6, 0.08), 2.0),
    (CharucoBoard(9, 7, 0.08, 0.056), 1.0),
    (CircleGrid(8, 6, 0.09), 2.0),
    (CircleGrid(4, 9, 0.14, asymmetric=True), 2.0),
)


@pytest.mark.parametrize(("board", "margin"), BOARDS, ids=["chessboard", "charuco", "circles", "asymmetric"])
def test_board_points_are_found_where_they_are(board, margin):
    camera, _ = rig(0.5)
    sheet = standing(board, (0.05, 2.3, 1.2), (15, -20, 8))
    picture = exposed(look(camera, (sheet,), samples=1).expose(ambient=0.9), np.random.default_rng(1))

    view = view_of("view", picture, board, full_scale=1023)

    assert view.detection is not None
    assert view.issues == ()
    step_m = getattr(board, "spacing_m", None) or board.square_m
    on_sheet = view.points_m[:, :2] + margin * step_m
    truth = project(camera, sheet.position_m + on_sheet @ sheet.world_from_sheet[:, :2].T)
    # A board may be numbered from its other end; the set of points is what counts.
    error = np.linalg.norm(view.detection.pixels_px[:, None] - truth[None], axis=2).min(axis=1)
    # Corners: 0.1 px at 10-bit noise in half-size pictures; circles: their ellipse's centre is biased.
    assert np.sqrt(np.mean(error**2)) < (0.25 if isinstance(board, CircleGrid) else 0.1)


def test_a_board_that_is_not_there_a_saturated_and_a_blurred_one_are_named():
    camera, _ = rig(0.5)
    board = Chessboard(9, 6, 0.08)
    luminance = look(camera, (standing(board, (0.0, 2.3, 1.2), (0, 10, 0)),), samples=1).expose(ambient=1.0)
    rng = np.random.default_rng(2)

    empty = view_of("empty", np.full((512, 640), 200, np.uint16), board, 1023)
    bright = view_of("bright", exposed(luminance * 2.0, rng), board, 1023)
    # 10 bits at the top of 16: the highest count is 65472.
    aligned = view_of("aligned", exposed(luminance * 2.0, rng) * np.uint16(64), board)
    sound = view_of("sound", exposed(luminance, rng) * np.uint16(64), board)
    smeared = sum(np.roll(luminance, shift, axis=1) for shift in range(-6, 7)) / 13
    moved = view_of("moved", exposed(smeared, rng), board, 1023)

    assert not empty.usable
    assert "not found" in empty.issues[0]
    assert any("saturated" in issue and "shorter exposure" in issue for issue in bright.issues)
    assert any("saturated" in issue for issue in aligned.issues)
    assert sound.issues == ()
    assert any("blur" in issue for issue in moved.issues) or not moved.usable


def test_a_single_row_of_a_board_is_named_and_not_used():
    camera, _ = rig(0.5)
    board = CharucoBoard(9, 7, 0.08, 0.056)
    sheet = standing(board, (0.0, 2.3, 1.2), (0, 15, 0))
    # Covered but for the margin and two rows of squares, between which lies one row of corners.
    paint = sheet.paint.copy()
    paint[3 * 40 :] = 200
    picture = exposed(
        look(camera, (dataclasses.replace(sheet, paint=paint),), samples=1).expose(ambient=0.9),
        np.random.default_rng(1),
    )

    view = view_of("covered", picture, board, full_scale=1023)

    assert board.detect(picture) is not None
    assert not view.usable
    assert "covered: a single row of the board is seen" in view.issues[0]


def test_two_rows_and_two_columns_tell_how_a_board_stands():
    points = Chessboard(9, 6, 0.08).points_m
    assert fixes_pose(points)
    assert fixes_pose(points[[0, 1, 9, 10]])
    for row in ([0, 1, 2, 3, 4, 5], [0, 10, 20, 30, 40, 50], [0, 1, 2, 3, 4, 5, 9], [0, 1, 9]):
        assert not fixes_pose(points[row])


def test_impossible_boards_are_refused():
    with pytest.raises(CalibrationError, match=r"75 mm is 0\.075"):
        Chessboard(9, 7, 75.0)
    with pytest.raises(CalibrationError, match="smaller than squares"):
        CharucoBoard(9, 7, 0.05, 0.06)
    with pytest.raises(CalibrationError, match="Unknown marker dictionary"):
        CharucoBoard(9, 7, 0.05, 0.04, "DICT_NONE")


@pytest.mark.parametrize("kind", get_args(BoardKind))
def test_every_kind_that_has_a_name_is_found_in_its_own_print(kind: BoardKind):
    board = board_of(kind, 7, 6, 0.03, None, "DICT_5X5_250")

    seen = board.detect(board.draw(40))

    assert seen is not None
    np.testing.assert_array_equal(np.sort(seen.ids), np.arange(len(board.points_m)))
    # Which corner is the first one the detector may choose: what is held is how far apart neighbours are.
    np.testing.assert_allclose(
        nearest(seen.pixels_px), nearest(board.points_m) / board.pitch_m * 40, rtol=0.02
    )


def nearest(points: np.ndarray) -> np.ndarray:
    """Every point's distance to its nearest neighbour, the smallest first."""
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return np.sort(np.where(apart > 0, apart, np.inf).min(axis=1))
