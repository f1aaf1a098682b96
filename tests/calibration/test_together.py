"""Two cameras of one room, at the walls y_max and x_max, by points with the scatter that corners have."""

import functools
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration import tie
from calibration.adjustment import adjust
from calibration.board import Chessboard
from calibration.bundle import Bundle, from_json, to_json
from calibration.errors import BundleError, CalibrationError
from calibration.model import build
from calibration.record import Placement, Record, SeenBoard, rows_of
from calibration.shared import SharedBoard, SharedRecord, shared_from_json, shared_to_json
from calibration.tie import NothingSharedError, Seat, groups
from calibration.together import Stated, Together, adjust_together
from calibration.world import difference, shifted
from core.geometry import Optics, WallName, looking_along_y
from core.view_frame import turn_to
from tests.calibration.practice import FACING, project, turned

BOARD = Chessboard(9, 6, 0.075)
CORNER_PX = 0.05
WALLS: tuple[WallName, ...] = ("y_max", "x_max")
ROOM_M = np.array([4.0, 4.0, 2.5])
STATED = Stated()


@dataclass(frozen=True)
class Rig:
    """The truth, the records of both cameras alone, and the places of a board that both saw."""

    truth: tuple[Optics, Optics]
    records: tuple[Record, ...]
    shared: tuple[SharedBoard, ...]

    def seats(self) -> tuple[Seat, Seat]:
        one, other = (Seat(build(record)) for record in self.records)
        return one, other

    def relative_error(self, found: tuple[Optics, Optics]) -> np.ndarray:
        """Rotation [rad] and place [m] of the second camera as the first one has it, found minus true."""
        (r0, p0), (r1, p1) = ((o.rotation, np.array(o.position_m)) for o in found)
        (q0, s0), (q1, s1) = ((o.rotation, np.array(o.position_m)) for o in self.truth)
        turn = Rotation.from_matrix((r1 @ r0.T) @ (q1 @ q0.T).T).as_rotvec()
        return np.concatenate([turn, r0 @ (p1 - p0) - q0 @ (s1 - s0)])


def seen(optics: Optics, centre_m: np.ndarray, frame: np.ndarray, name: str, rng) -> SeenBoard:
    """The board's corners in a picture, where the board stands so."""
    flat = BOARD.points_m - BOARD.points_m.mean(axis=0)
    pixels = project(optics, flat @ frame.T + centre_m)
    pixels = pixels + CORNER_PX * rng.standard_normal(pixels.shape)
    return SeenBoard(name, f"{optics.position_m}{name}", rows_of(BOARD.points_m), rows_of(pixels))


def camera(wall: WallName, rng) -> Optics:
    """A camera outside the room, some 4 m before its wall."""
    turn = turn_to(wall)
    optics = looking_along_y(position_m=(0.0, 0.0, 1.2), width_px=1280, height_px=1024, focal_px=1200.0)
    optics = turned(optics, tuple(0.02 * rng.standard_normal(3)))
    place = np.array([0.0, -4.5, 1.2]) + turn.matrix @ np.array([*ROOM_M[:2], 0.0])
    place[0] = (turn.matrix @ (ROOM_M / 2))[0]
    return turn.back().optics(replace(optics, position_m=tuple(map(float, place))))


def record_of(wall: WallName, name: str, optics: Optics, rng) -> Record:
    """Nine boards before the camera, one on the wall, held level, and what a tape tells: each a little wrong."""
    turn = turn_to(wall)
    framed, into = turn.optics(optics), turn.matrix
    boards = []
    for number in range(9):
        u, v = rng.uniform(0.3, 0.7, 2) * (optics.width_px, optics.height_px)
        ray = optics.rotation.T @ np.array([(u - 640) / 1200, (v - 512) / 1200, 1.0])
        tilt = Rotation.from_euler("xyz", [*rng.uniform(-0.5, 0.5, 2), rng.uniform(0, 6)]).as_matrix()
        place = np.array(optics.position_m) + rng.uniform(1.6, 2.6) * ray
        boards.append(seen(optics, place, optics.rotation.T @ tilt, f"own {number}", rng))
    # The wall as it is: off by the tape's error, out of square; the board on it is not quite level.
    wall_m = float(turn.point(tuple(ROOM_M))[1]) + STATED.tape_std_m * rng.standard_normal()
    tilts = STATED.square_std_rad * rng.standard_normal(2)
    level = STATED.level_std_rad * rng.standard_normal()
    frame = Rotation.from_euler("xzy", [tilts[0], tilts[1], 0.0]).as_matrix() @ FACING
    frame = frame @ Rotation.from_euler("z", level).as_matrix()
    middle = np.array([framed.position_m[0], wall_m, framed.position_m[2]])
    on_wall = seen(optics, into.T @ middle, into.T @ frame, "level", rng)
    at_m = np.array(framed.position_m) + STATED.tape_std_m * rng.standard_normal(3)
    place = Placement(None, float(at_m[0]), float(at_m[2]), float(turn.point(tuple(ROOM_M))[1]), None, wall)
    size = (optics.width_px, optics.height_px)
    return Record(name, size, None, tuple(boards), None, on_wall, place)


def rig(seed: int, places: int = 6) -> Rig:
    rng = np.random.default_rng(seed)
    one, other = (camera(wall, rng) for wall in WALLS)
    records = [record_of(w, n, o, rng) for w, n, o in zip(WALLS, ("a", "b"), (one, other), strict=True)]
    shared = []
    for number in range(places):
        # Between the two: facing the bisector of their axes, where both see it.
        frame = Rotation.from_euler("z", -45, degrees=True).as_matrix() @ FACING
        frame = frame @ Rotation.from_euler("xyz", [*rng.uniform(-0.3, 0.3, 2), 0]).as_matrix()
        centre = np.array([2.0, 2.0, 1.2]) + rng.uniform(-0.8, 0.8, 3) * (1, 1, 0.6)
        both = {n: seen(o, centre, frame, f"place {number}", rng) for n, o in (("a", one), ("b", other))}
        shared.append(SharedBoard(f"place {number}", both))
    return Rig((one, other), tuple(records), tuple(shared))


def found(together: Together) -> tuple[Optics, Optics]:
    return together.views["a"].camera.optics, together.views["b"].camera.optics


def alone(made: Rig) -> tuple[Optics, Optics]:
    one, other = (seat.model.camera_optics.optics for seat in made.seats())
    return one, other


def relative_covariance(now: tuple[Optics, Optics], whole: np.ndarray) -> np.ndarray:
    """The covariance of `Rig.relative_error`, from that of both cameras by differences."""
    at_now = Rig(now, (), ())
    slopes = []
    for index in range(30):
        change = np.zeros(30)
        change[index] = 1e-6
        moved = shifted(now[0], change[:15]), shifted(now[1], change[15:])
        slopes.append(at_now.relative_error(moved) / 1e-6)
    by = np.stack(slopes, axis=1)
    return by @ whole @ by.T


def joint_of(together: Together) -> tuple[tuple[Optics, Optics], np.ndarray]:
    """Both cameras and their joint covariance."""
    return found(together), together.joint.covariance_of("a", "b")


def normalised(error: np.ndarray, covariance: np.ndarray) -> float:
    """Mean square of the error in units of its own covariance: 1 where that is honest."""
    return float(error @ np.linalg.solve(covariance, error) / len(error))


@functools.cache
def practised(seed: int) -> tuple[Rig, Together]:
    made = rig(seed)
    return made, adjust_together(made.seats(), made.shared, STATED)


def test_a_common_board_ties_two_cameras_ten_times_as_well_as_their_walls_and_says_how_well():
    before, after, honest, in_room = [], [], [], []
    boards = set()
    for seed in range(3):
        made, together = practised(seed)
        boards.add((together.joint.boards, together.contradictions))
        before.append(made.relative_error(alone(made)))
        after.append(made.relative_error(found(together)))
        honest.append(normalised(after[-1], relative_covariance(*joint_of(together))))
        pairs = zip(found(together), made.truth, strict=True)
        off = np.concatenate([difference(now, truth)[9:] for now, truth in pairs])
        poses = np.r_[9:15, 24:30]
        in_room.append(normalised(off, together.joint.covariance_of("a", "b")[np.ix_(poses, poses)]))
    rms = [np.sqrt(np.mean(np.square(errors), axis=0)) for errors in (before, after)]
    assert np.linalg.norm(rms[1][:3]) < 0.1 * np.linalg.norm(rms[0][:3])
    assert np.linalg.norm(rms[1][3:]) < 0.15 * np.linalg.norm(rms[0][3:])
    # Of 18 numbers chi-square is between these with 99.8 %; of 36 for the poses in the room.
    assert 0.27 < np.mean(honest) < 2.35
    assert 0.42 < np.mean(in_room) < 1.89
    assert boards == {(6, ())}


def test_each_picture_counts_by_its_own_noise():
    # Three of six places are found badly. One device's noise for all of them spoils what the good ones tell.
    spread = {}
    for rounds in (0, tie.ROUNDS):
        errors = []
        for seed in range(4):
            made, rng = rig(seed), np.random.default_rng(100 + seed)
            shared = tuple(
                replace(board, seen={name: noisier(one, 0.13, rng) for name, one in board.seen.items()})
                if number % 2
                else board
                for number, board in enumerate(made.shared)
            )
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(tie, "ROUNDS", rounds)
                together = adjust_together(made.seats(), shared, STATED)
            assert together.tied.moved == ()
            errors.append(made.relative_error(found(together)))
        spread[rounds] = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.linalg.norm(spread[tie.ROUNDS][3:]) < 0.95 * np.linalg.norm(spread[0][3:])


def test_the_noise_of_a_picture_is_read_off_its_own_residuals():
    made = rig(1)
    fit = made.seats()[0].model.camera
    bad = replace(
        fit.sightings[2],
        pixels_px=np.array(noisier(made.records[0].boards[2], 0.14, np.random.default_rng(3)).camera_px),
    )
    sightings = (*fit.sightings[:2], bad, *fit.sightings[3:])
    adjusted = adjust(fit.adjusted.devices, fit.adjusted.poses, sightings)
    noise_px = [one.noise_nd * adjusted.devices[0].sigma_px for one in tie.weighed(sightings, adjusted)]
    # 108 numbers tell a standard deviation to 7 %; a little of the bad one's share goes to all.
    assert noise_px[2] == pytest.approx(np.hypot(CORNER_PX, 0.14), rel=0.25)
    assert np.delete(noise_px, 2) == pytest.approx(np.full(8, CORNER_PX), rel=0.3)


def noisier(board: SeenBoard, by_px: float, rng) -> SeenBoard:
    pixels = np.array(board.camera_px)
    return replace(board, camera_px=rows_of(pixels + by_px * rng.standard_normal(pixels.shape)))


def test_nothing_shared_is_refused_with_what_to_do():
    made, _ = practised(0)
    with pytest.raises(NothingSharedError, match=r"'b' to 'a'. Take pictures of one board by both cameras"):
        adjust_together(made.seats(), ())
    bare = tuple(replace(seat, model=build(replace(seat.model.record, level=None))) for seat in made.seats())
    with pytest.raises(CalibrationError, match="No view has found its wall"):
        adjust_together((bare[0], bare[1]), made.shared)


def test_a_board_that_moved_between_the_two_pictures_is_named_and_left_out():
    made, good = practised(0)
    moved = {
        "b": made.shared[2].seen["b"],
        "a": replace(made.shared[3].seen["a"], sha256="another"),
    }
    together = adjust_together(made.seats(), (*made.shared, SharedBoard("shaky", moved)))

    assert together.tied.moved == ("shaky",)
    for one, other in zip(found(together), found(good), strict=True):
        np.testing.assert_allclose(one.position_m, other.position_m, atol=1e-6)


def test_a_picture_that_a_camera_was_calibrated_with_counts_once():
    made, good = practised(0)
    record = made.records[0]
    with_shared = record.with_boards(tuple(board.seen["a"] for board in made.shared))
    seats = Seat(build(with_shared)), made.seats()[1]

    together = adjust_together(seats, made.shared)

    assert together.joint.boards == 6
    std = [np.sqrt(np.diag(t.views["b"].camera.covariance_matrix())) for t in (together, good)]
    np.testing.assert_allclose(std[0], std[1], rtol=0.15)


def test_a_camera_that_was_stated_elsewhere_is_told():
    made, _ = practised(0)
    record = made.records[1]
    off = replace(record, placement=replace(record.placement, x_m=record.placement.x_m + 0.08))
    together = adjust_together((made.seats()[0], Seat(build(off))), made.shared)
    assert "mm from where the others have it" in together.contradictions[0]
    assert "'b'" in "".join(together.contradictions)


def test_one_projector_that_lit_the_boards_of_both_ties_them():
    rng = np.random.default_rng(5)
    made = rig(5)
    one = made.truth[0]
    aside = (one.position_m[0] + 0.8, one.position_m[1], one.position_m[2])
    other = replace(one, position_m=aside)
    lamp = replace(one, position_m=(aside[0] - 0.3, aside[1], aside[2] - 0.5))
    records = []
    for name, optics in (("a", one), ("b", other)):
        record = record_of("y_max", name, optics, rng)
        boards = tuple(lit(board, optics, lamp, rng) for board in record.boards)
        records.append(replace(record, boards=boards, panel_size_px=(lamp.width_px, lamp.height_px)))
    seats = tuple(Seat(build(record), "the projector") for record in records)

    together = adjust_together((seats[0], seats[1]), ())

    assert together.joint.parts == ("a", "b", "projector of a")
    lamps = [view.projector for view in together.views.values()]
    assert lamps[0] is not None
    assert lamps[1] is not None
    assert lamps[0].optics == lamps[1].optics
    both = replace(made, truth=(one, other), records=(records[0], records[1]))
    error = both.relative_error(found(together))
    assert normalised(error, relative_covariance(*joint_of(together))) < 3.74  # six numbers, 99.9 %
    assert np.linalg.norm(error[3:]) < 0.005
    assert groups((seats[0], replace(seats[1], projector="another")), ()) != [seats]


def lit(board: SeenBoard, camera: Optics, lamp: Optics, rng) -> SeenBoard:
    """The board with the places on the panel that light its corners."""
    fit = cv2.solvePnP(
        np.array(board.points_m),
        np.array(board.camera_px),
        np.array(
            [
                [camera.focal_px[0], 0, camera.principal_px[0]],
                [0, camera.focal_px[1], camera.principal_px[1]],
                [0, 0, 1],
            ]
        ),
        np.zeros(5),
    )
    local = np.array(board.points_m) @ cv2.Rodrigues(fit[1])[0].T + fit[2].ravel()
    panel = project(lamp, local @ camera.rotation + np.array(camera.position_m))
    panel = panel + CORNER_PX * rng.standard_normal(panel.shape)
    return replace(board, panel_points_m=board.points_m, panel_px=rows_of(panel))


def test_the_joint_covariance_survives_text_and_knows_its_parts():
    made, together = practised(0)
    bundle = Bundle(date="2026-03-01T12:00:00+00:00", joint=together.joint)
    assert from_json(to_json(bundle)).joint == together.joint
    shared = SharedRecord(made.shared)
    assert shared_from_json(shared_to_json(shared), "shared.json") == shared
    with pytest.raises(
        BundleError, match="'c' was not adjusted together with the others; known are 'a', 'b'"
    ):
        together.joint.covariance_of("a", "c")
