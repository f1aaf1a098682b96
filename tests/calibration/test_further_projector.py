"""A second projector before a camera that is calibrated: the camera stands, the projector alone is fitted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.board import Chessboard
from calibration.bundle import CalibratedOptics
from calibration.errors import TooFewViewsError
from calibration.further_projector import build_projector
from calibration.model import rows
from calibration.record import Record, SeenBoard, rows_of
from calibration.world import difference, shifted
from core.geometry import Optics
from tests.calibration.practice import FACING, project, rig

BOARD = Chessboard(9, 6, 0.075)
CORNER_PX, PANEL_PX = 0.05, 0.1
# How well a camera is known: focal length and principal point [px], k1, its pose [rad, m].
STD = np.array([1.0, 1.0, 1.5, 1.5, 2e-3, 0, 0, 0, 0, *[4e-4] * 3, *[5e-3] * 3])


def record_of(camera: Optics, projector: Optics, rng: np.random.Generator, boards: int = 8) -> Record:
    """Boards under the projector's Gray code, with the scatter that corners have."""
    flat, seen = BOARD.points_m - BOARD.points_m.mean(axis=0), []
    for number in range(boards):
        tilt = Rotation.from_euler("xyz", [*rng.uniform(-0.5, 0.5, 2), rng.uniform(0, 6)]).as_matrix()
        centre = np.array([0.0, 2.5, 1.2]) + rng.uniform(-0.35, 0.35, 3)
        points = flat @ (FACING @ tilt).T + centre
        on_camera, on_panel = (
            project(optics, points) + std * rng.standard_normal((len(points), 2))
            for optics, std in ((camera, CORNER_PX), (projector, PANEL_PX))
        )
        at = rows_of(BOARD.points_m)
        seen.append(SeenBoard(f"place {number}", str(number), at, rows_of(on_camera), at, rows_of(on_panel)))
    size, panel = (camera.width_px, camera.height_px), (projector.width_px, projector.height_px)
    return Record("second", size, panel, tuple(seen))


def known_camera(camera: Optics, rng: np.random.Generator) -> CalibratedOptics:
    return CalibratedOptics("first", shifted(camera, STD * rng.standard_normal(15)), rows(np.diag(STD**2)))


def simple() -> tuple[Optics, Optics]:
    """The rig of practice with one coefficient a lens, so that all that is wrong with the camera is stated."""
    (camera, projector), bent = rig(), (-0.05, 0.0, 0.0, 0.0, 0.0)
    return replace(camera, distortion=bent), replace(projector, distortion=bent)


def test_a_second_projector_is_found_as_well_as_its_camera_is_known_and_says_so():
    camera, projector = simple()
    normalised, apart = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        known = known_camera(camera, rng)
        found = build_projector(record_of(camera, projector, rng), known).optics
        # Pose, in the room and from the camera: intrinsics that are fixed have no deviation.
        error = difference(found.optics, projector)[9:]
        covariance = found.covariance_matrix()[9:, 9:]
        normalised.append(error @ np.linalg.solve(covariance, error) / 6)
        off = error[3:] - difference(known.optics, camera)[12:]
        by = np.hstack([np.eye(3), -np.eye(3)])
        both = np.block(
            [
                [found.covariance_matrix()[12:, 12:], found.cross_covariance_matrix()[12:, 12:]],
                [found.cross_covariance_matrix()[12:, 12:].T, np.diag(STD[12:] ** 2)],
            ]
        )
        apart.append(off @ np.linalg.solve(by @ both @ by.T, off) / 3)
    # Means of 36 and 18 squares of one: 1 with standard deviations of 0.24 and 0.33; three of each.
    assert np.mean(normalised) == pytest.approx(1.0, abs=0.72)
    assert np.mean(apart) == pytest.approx(1.0, abs=1.0)


def test_two_boards_are_too_few_for_a_projector():
    camera, projector = simple()
    rng = np.random.default_rng(0)
    with pytest.raises(TooFewViewsError, match="2 boards carry usable Gray code; expected at least 3"):
        build_projector(record_of(camera, projector, rng, 2), known_camera(camera, rng))
