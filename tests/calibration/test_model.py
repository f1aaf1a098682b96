import dataclasses
import functools

import numpy as np
import pytest

from calibration.board import Chessboard
from calibration.errors import CalibrationError
from calibration.graycode import decode, patterns
from calibration.local import on_panel
from calibration.model import Model, build
from calibration.record import (
    Placement,
    Record,
    SeenBoard,
    SeenWall,
    record_from_json,
    record_to_json,
    rows_of,
    seen_board,
)
from calibration.simulated_pictures import look
from calibration.stripes import stripe_edges
from calibration.vertical import upper_edge
from calibration.views import digest, view_of
from calibration.wall import correspondences
from tests.calibration.practice import STANDS, exposed, project, rig, standing, wall

BOARD = Chessboard(9, 6, 0.075)
SCALE = 0.5
# A measured point of the wall near its middle, in world coordinates.
MARK_M = np.array([0.0, 3.0, 1.2])


@functools.cache
def practised() -> Record:
    """Twelve boards, eight of them under Gray code, then the bare wall: single frames, half size, 10 bits."""
    rng = np.random.default_rng(7)
    camera, projector = rig(SCALE)
    panel = (projector.width_px, projector.height_px)
    shown = patterns(*panel).astype(np.float32) / 255
    boards = []
    for number, stand in enumerate(STANDS):
        seen = look(camera, (wall(), standing(BOARD, *stand)), projector, samples=1)
        coded = shown if number < 8 else shown[-2:]
        frames = np.stack([exposed(seen.expose(p, 0.02), rng) for p in coded])
        view = view_of(f"board {number}", frames[-2], BOARD, 1023)
        assert view.detection is not None
        board = seen_board(view, digest(frames[-2]))
        if number < 8:
            decoded = decode(frames, *panel)
            edges = stripe_edges(frames, decoded, *panel)
            places, good, _ = on_panel(decoded, edges, view.detection.pixels_px, 9)
            assert good.mean() > 0.8
            points = rows_of(view.points_m[good])
            board = dataclasses.replace(board, panel_points_m=points, panel_px=rows_of(places[good]))
        boards.append(board)
    bare = look(camera, (wall(),), projector, samples=1)
    frames = np.stack([exposed(bare.expose(p, 0.02), rng) for p in shown])
    decoded = decode(frames, *panel)
    found = correspondences(decoded, stripe_edges(frames, decoded, *panel), 18)
    seen_wall = SeenWall("wall", digest(frames[-2]), rows_of(found.camera_px), rows_of(found.projector_px))
    size = (camera.width_px, camera.height_px)
    return Record("camera", size, panel, tuple(boards), seen_wall)


@functools.cache
def practised_model() -> Model:
    u, v = project(rig(SCALE)[0], MARK_M[None])[0]
    # Two points of the wall, one straight above the other in gravity's direction.
    sheet = wall()
    up = np.array([0.0, 0.0, 1.0]) - sheet.world_from_sheet[2, 2] * sheet.world_from_sheet[:, 2]
    ends = project(rig(SCALE)[0], np.stack([MARK_M - 0.5 * up, MARK_M + 0.5 * up]))
    place = Placement((u, v), 0.0, 1.2, 3.0, (*ends[0], *ends[1]))
    return build(dataclasses.replace(practised(), placement=place))


def true_world() -> np.ndarray:
    """Rows: the axes that a world bound to the oblique wall has, in the rig's coordinates."""
    normal = wall().world_from_sheet[:, 2]
    z_axis = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    z_axis /= np.linalg.norm(z_axis)
    return np.stack([np.cross(normal, z_axis), normal, z_axis])


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1))))


def test_the_rig_is_found_to_a_tenth_of_a_percent_a_millimetre_and_hundredths_of_a_degree():
    model = practised_model()
    axes = true_world()
    pairs = zip((model.camera_optics, model.projector_optics), rig(SCALE), strict=True)
    for found, truth in pairs:
        assert found is not None
        np.testing.assert_allclose(found.optics.focal_px, truth.focal_px, rtol=1e-3)
        position = axes @ (np.array(truth.position_m) - MARK_M) + MARK_M
        # Half-size pictures, one frame each: full size is twice as good (tests/benchmarks/calibration.py).
        assert np.linalg.norm(np.array(found.optics.position_m) - position) < 2.5e-3
        assert angle_deg(found.optics.rotation, truth.rotation @ axes.T) < 0.04


def test_the_wall_is_found_to_a_millimetre():
    model = practised_model()
    assert model.wall is not None
    assert model.flat_wall is not None
    np.testing.assert_allclose(model.wall.normal, [0.0, 1.0, 0.0], atol=1e-9)
    assert model.wall.point_m[1] == pytest.approx(3.0, abs=1e-3)
    assert model.wall.flatness_rms_m < 1e-3
    assert model.wall.offset_std_m < 2e-3
    assert model.flat_wall.rms_px < 0.05


def test_errors_lie_within_their_standard_deviations():
    model = practised_model()
    truth = rig(SCALE)[0]
    std = np.sqrt(np.diag(model.camera_optics.covariance_matrix()))
    off = np.subtract(model.camera_optics.optics.focal_px, truth.focal_px)
    position = true_world() @ (np.array(truth.position_m) - MARK_M) + MARK_M
    off_m = np.subtract(model.camera_optics.optics.position_m, position)

    # One draw of five numbers: beyond five deviations would be a wrong covariance; and it is no joke value.
    assert np.all(np.abs(off) < 5 * std[:2])
    assert np.all(np.abs(off_m) < 5 * std[12:])
    assert std[:2].max() < 3e-3 * truth.focal_px[0]
    assert std[12:].max() < 0.01


def test_a_partial_record_gives_what_it_can_and_survives_text():
    record = practised()
    camera_only = dataclasses.replace(
        record,
        panel_size_px=None,
        wall=None,
        boards=tuple(dataclasses.replace(b, panel_points_m=(), panel_px=()) for b in record.boards),
    )

    model = build(record_from_json(record_to_json(camera_only), "record.json"))

    assert model.projector_optics is None
    assert model.wall is None
    assert model.camera_optics.optics.focal_px[0] == pytest.approx(950.0, rel=2e-3)
    # Without a wall the world is the camera's: at the origin, looking along y.
    assert model.camera_optics.optics.position_m == (0.0, 0.0, 0.0)
    assert model.camera_optics.quality.views == 12


def test_two_boards_are_too_few_and_the_message_says_how_many():
    record = dataclasses.replace(practised(), boards=practised().boards[:2])
    with pytest.raises(CalibrationError, match="2 usable board views; expected at least 3"):
        build(record)


def test_boards_that_all_face_the_camera_leave_the_focal_length_open():
    size_px, pixels = np.array(practised().camera_size_px), BOARD.points_m[:, :2] / BOARD.square_m
    rng = np.random.default_rng(1)
    facing = []
    for number in range(8):
        px_per_square = rng.uniform(20, 30)
        corner = rng.uniform(0.05, 0.3, 2) * size_px
        shown = corner + px_per_square * pixels + rng.normal(0, 0.05, pixels.shape)
        facing.append(SeenBoard(str(number), str(number), rows_of(BOARD.points_m), rows_of(shown)))
    size = practised().camera_size_px
    with pytest.raises(CalibrationError, match="tilted by 30 degrees"):
        build(Record("camera", size, boards=tuple(facing)))


def test_a_board_of_which_a_record_holds_a_single_row_is_named():
    first, second, *others = practised().boards
    row = dataclasses.replace(second, points_m=second.points_m[:9], camera_px=second.camera_px[:9])
    with pytest.raises(CalibrationError, match="board 1: a single row"):
        build(dataclasses.replace(practised(), boards=(first, row, *others)))


def test_a_level_board_on_the_wall_places_a_camera_without_projector():
    camera, _ = rig(SCALE)
    sheet = wall()
    axes = true_world()
    frame = np.stack([axes[0], -axes[2], axes[1]], axis=1)
    print_out = BOARD.draw(40)
    flat = dataclasses.replace(
        sheet,
        paint=print_out,
        px_per_m=40 / BOARD.square_m,
        position_m=MARK_M - 0.4 * frame[:, 0] - 0.3 * frame[:, 1] - 1e-6 * frame[:, 2],
        world_from_sheet=frame,
        beyond=None,
    )
    picture = exposed(look(camera, (sheet, flat), samples=1).expose(ambient=1.0), np.random.default_rng(3))
    view = view_of("level", picture, BOARD, 1023)
    record = dataclasses.replace(
        practised(),
        wall=None,
        panel_size_px=None,
        level=seen_board(view, digest(picture)),
        placement=Placement(None, 0.0, 1.2, 3.0),
    )

    model = build(record)

    assert model.wall is not None
    assert angle_deg(model.camera_optics.optics.rotation, camera.rotation @ axes.T) < 0.15
    true_distance_m = sheet.world_from_sheet[:, 2] @ (MARK_M - np.array(camera.position_m))
    assert 3.0 - model.camera_optics.optics.position_m[1] == pytest.approx(true_distance_m, rel=2e-3)


@pytest.mark.parametrize("plumb", [False, True])
def test_a_plumb_line_tells_which_end_of_a_level_board_is_up(plumb):
    # The camera hangs upside down: as its pictures show it, the board's first row is the lowest.
    size_px = np.array(practised().camera_size_px)
    level = next(board for board in practised().boards if board.name == "board 0")
    hanging = dataclasses.replace(
        level, name="level", camera_px=rows_of(size_px - 1 - np.array(level.camera_px))
    )
    middle, high = float(size_px[0]) / 2, float(size_px[1])
    record = dataclasses.replace(
        practised(),
        wall=None,
        panel_size_px=None,
        level=hanging,
        placement=Placement(None, 0.0, 1.2, 3.0, (middle, 0.3 * high, middle, 0.7 * high) if plumb else None),
    )

    optics = build(record).camera_optics.optics

    assert upper_edge(optics) == ("lower" if plumb else "upper")
