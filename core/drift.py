"""A small motion of the whole picture between two exposures: what a camera on its mount may do.

Fitted to windows that are known to be still, and taken out of the reference picture. What stays unknown of it is
`core.motion`.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from core.data_error import CORRELATED_DATA
from core.motion import likeliest_motion, similarity_basis
from core.problem import ShiftMeasurement
from core.setting import setting

Image = Float[np.ndarray, "rows cols"]


# Of the robust fit: each round's weights are by the last one's residual.
_ROUNDS = 5


@setting
class Similarity:
    """A small motion of the whole image about its centre: shift [px], rotation [rad], scale - 1."""

    column_px: float = 0.0
    row_px: float = 0.0
    rotation_rad: float = 0.0
    dilation: float = 0.0

    def displacement_px(
        self, points_px: Float[np.ndarray, "points 2"], shape: tuple[int, int]
    ) -> Float[np.ndarray, "points 2"]:
        """Displacement (column, row) of image points, to first order in the angle and the dilation."""
        return similarity_basis(points_px, shape) @ np.array(
            [self.column_px, self.row_px, self.rotation_rad, self.dilation]
        )

    def after(self, first: "Similarity") -> "Similarity":
        """Both motions, to first order."""
        return Similarity(
            column_px=self.column_px + first.column_px,
            row_px=self.row_px + first.row_px,
            rotation_rad=self.rotation_rad + first.rotation_rad,
            dilation=self.dilation + first.dilation,
        )


def fit_similarity(
    measurement: ShiftMeasurement, static: np.ndarray, shape: tuple[int, int]
) -> tuple[Similarity, Float[np.ndarray, "4 4"]]:
    """Weighted fit over the windows where `static` is true: the motion and its covariance."""
    basis = similarity_basis(measurement.centres_px[static], shape)
    information = measurement.information_per_px2[static]
    weighted = np.einsum("wab,wbp->wap", information, basis)
    normal = np.einsum("wap,waq->pq", basis, weighted)
    # Scaled, since a radian moves a window by a thousand pixels.
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-10) / np.outer(scale, scale)
    solution = inverse @ np.einsum("wap,wa->p", weighted, measurement.displacement_px[static])
    column, row, rotation, dilation = (float(v) for v in solution)
    return Similarity(column_px=column, row_px=row, rotation_rad=rotation, dilation=dilation), inverse


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


def move_image(image: Image, motion: Similarity) -> Image:
    """`image` as it looks after `motion`, by a quintic spline (edges are repeated).

    Only a prediction is moved (the reference, to where the flow image should be); measured flow frames
    are never resampled.
    """
    centre = (np.array(image.shape) - 1) / 2
    c, s = np.cos(motion.rotation_rad), np.sin(motion.rotation_rad)
    # From output (row, column) to input: undo the motion.
    inverse = np.array([[c, -s], [s, c]]) / (1 + motion.dilation)
    shift = np.array([motion.row_px, motion.column_px])
    offset: Any = centre - inverse @ (centre + shift)
    return ndimage.affine_transform(image, inverse, offset=offset, order=5, mode="nearest")
