"""A small motion of the camera between two exposures: what it may do on its mount.

Fitted to windows that are known to be still, and taken out of the reference picture. What stays unknown of it is
`core.motion`.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from core.data_error import CORRELATED_DATA
from core.geometry import Optics
from core.motion import MOTIONS, likeliest_motion, motion_basis
from core.problem import ShiftMeasurement

Image = Float[np.ndarray, "rows cols"]
# A motion of the camera, as the six of `motion_basis` [px].
Motion = Float[np.ndarray, " 6"]
STILL: Motion = np.zeros(MOTIONS)
Powers = Callable[[Float[np.ndarray, " points"]], Float[np.ndarray, "points powers"]]


# Of the robust fit: each round's weights are by the last one's residual.
_ROUNDS = 5
# Of a picture: rows moved at a time, and the degree of the polynomials that a motion is written in.
_ROWS, _POWERS = 256, 9
# The picture goes on so far beyond its edge: what an edge does to a spline's coefficients is gone by then.
_EDGE_PX = 12


def fit_motion(
    measurement: ShiftMeasurement,
    still: Bool[np.ndarray, " windows"],
    optics: Optics,
    expected_px: Motion,
    std_px: float,
) -> tuple[Motion, Float[np.ndarray, "6 6"]]:
    """The likeliest motion of the camera by the windows where `still` is true, and its covariance.

    Before the windows are looked at each of the six motions has the mean `expected_px` and the deviation `std_px`.
    """
    basis = std_px * motion_basis(measurement.centres_px[still], optics)
    weighted = np.einsum("wab,wbp->wap", measurement.information_per_px2[still], basis)
    covariance = np.linalg.inv(np.einsum("wap,waq->pq", basis, weighted) + np.eye(MOTIONS))
    left = measurement.displacement_px[still] - basis @ (expected_px / std_px)
    found = std_px * covariance @ np.einsum("wap,wa->p", weighted, left)
    return expected_px + found, std_px**2 * covariance


def nearly_still(measurement: ShiftMeasurement) -> ShiftMeasurement:
    """The shifts without the motion that is likeliest if the air is still, to judge their size by.

    The few windows that moved much further than the others (a thermal layer beside a wall) hardly count.
    """
    if measurement.motion is None:
        return measurement
    motions = measurement.motion.at(measurement.centres_px)
    shifts = left = measurement.displacement_px
    covariance = np.linalg.inv(measurement.information_per_px2)
    for _ in range(_ROUNDS):
        size = np.linalg.norm(left, axis=1)
        error_px = np.maximum(np.median(size), size**2 / max(float(np.median(size)), 1e-12))
        weight = np.linalg.inv(covariance + (error_px**2)[:, None, None] * np.eye(2)) / CORRELATED_DATA
        left = shifts - motions @ likeliest_motion(motions, weight, shifts)
    return replace(measurement, displacement_px=left)


def move_image(image: Image, motion_px: Motion, optics: Optics) -> Image:
    """`image` as it looks after a motion of its camera, by a quintic spline (edges are repeated).

    Only a prediction is moved (the reference, to where the flow image should be); measured flow frames
    are never resampled.
    """
    single: Any = np.float32
    padded = np.pad(image, _EDGE_PX, mode="edge")
    coefficients = ndimage.spline_filter(padded, order=5, output=single, mode="nearest")
    moved, columns = np.empty(image.shape, np.float32), np.arange(image.shape[1], dtype=float)
    by_column, by_row, back = _way_back(motion_px, optics, image.shape)
    for first in range(0, image.shape[0], _ROWS):
        rows = np.arange(first, min(first + _ROWS, image.shape[0]), dtype=float)
        column, row = np.einsum("rb,abc->arc", by_row(rows), back) @ by_column(columns).T
        was = [row + (rows[:, None] + _EDGE_PX), column + (columns + _EDGE_PX)]
        moved[first : first + len(rows)] = ndimage.map_coordinates(
            coefficients, was, order=5, mode="nearest", prefilter=False
        )
    return moved


def _way_back(
    motion_px: Motion, optics: Optics, shape: tuple[int, ...]
) -> tuple[Powers, Powers, Float[np.ndarray, "2 powers powers"]]:
    """From a pixel to where it was before a motion: polynomials along both, and their products' coefficients.

    They hold the motion of any lens to a ten-thousandth of it.
    """
    nodes = np.polynomial.chebyshev.chebpts1(_POWERS + 3)
    powers = np.polynomial.chebyshev.chebvander(nodes, _POWERS)
    column, row = ((nodes + 1.0) / 2.0 * (length - 1) for length in shape[::-1])
    points = np.stack(np.meshgrid(column, row), axis=-1).reshape(-1, 2)
    # A motion of some pixels hardly changes over some pixels.
    once = points - motion_basis(points, optics) @ motion_px
    back = -(motion_basis(once, optics) @ motion_px).reshape(len(nodes), len(nodes), 2)
    inverse = np.linalg.pinv(powers)

    def along(length: int) -> Powers:
        return lambda at: np.polynomial.chebyshev.chebvander(2.0 * at / max(length - 1, 1) - 1.0, _POWERS)

    return along(shape[1]), along(shape[0]), np.einsum("br,rca,dc->abd", inverse, back, inverse)
