"""A view's calibration in the view's own frame, where the wall that it looks at is y_max."""

from dataclasses import replace

import numpy as np

from calibration.bundle import Bundle, CalibratedOptics, Rows
from core.geometry import WallName
from core.view_frame import Turn, turn_to


def turned(bundle: Bundle, wall: WallName) -> Bundle:
    """Camera, projector and wall of one view (`Bundle.of`) in its own frame; covariances follow."""
    turn = turn_to(wall)
    if turn.is_none:
        return bundle
    found = bundle.wall
    if found is not None:
        found = replace(found, point_m=turn.point(found.point_m), normal=turn.point(found.normal))
    projector = None if bundle.projector is None else _optics(bundle.projector, turn)
    return replace(
        bundle, cameras=tuple(_optics(one, turn) for one in bundle.cameras), projector=projector, wall=found
    )


def _optics(one: CalibratedOptics, turn: Turn) -> CalibratedOptics:
    """Only positions turn: rotations are about the optics' own axes."""
    by = np.eye(15)
    by[12:, 12:] = turn.matrix
    return replace(
        one,
        optics=turn.optics(one.optics),
        covariance=_rows(by, one.covariance),
        cross_covariance=_rows(by, one.cross_covariance),
    )


def _rows(by: np.ndarray, matrix: Rows | None) -> Rows | None:
    if matrix is None:
        return None
    return tuple(tuple(map(float, row)) for row in by @ np.array(matrix) @ by.T)
