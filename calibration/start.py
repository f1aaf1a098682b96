"""A start for the adjustment: intrinsics and board poses that are near enough for it to converge.

Zhang's closed form assumes a central principal point; a projector's may lie outside its panel. So
candidates (focal length x principal point) are tried, each with its best board poses, and the one that
predicts the corners best is kept.
"""

import cv2
import numpy as np
from jaxtyping import Float

from calibration.adjustment import Pose

Points3 = list[Float[np.ndarray, "_ 3"]]
Points2 = list[Float[np.ndarray, "_ 2"]]

# Heights of the principal point above the panel's centre, in panel heights: 100 % offset lenses and none.
_OFFSETS = (0.0, 0.5, -0.5, 0.75, -0.75)
_FOCALS = (0.6, 0.9, 1.3, 1.9, 2.8, 4.2, 6.3)


def guess_intrinsics(
    points_m: Points3, pixels_px: Points2, size_px: tuple[int, int], offset_lens: bool
) -> Float[np.ndarray, "9"]:
    """(f, f, cx, cy, 0...) with the smallest reprojection error among the candidates."""
    width, height = size_px
    best, best_error = np.zeros(9), np.inf
    for offset in _OFFSETS if offset_lens else (0.0,):
        for ratio in _FOCALS:
            focal = ratio * max(width, height)
            centre = ((width - 1) / 2, (height - 1) / 2 + offset * height)
            guess = np.array([focal, focal, *centre, 0, 0, 0, 0, 0], float)
            error = sum(
                guess_pose_and_error(p, q, guess)[1] for p, q in zip(points_m, pixels_px, strict=True)
            )
            if error < best_error:
                best, best_error = guess, error
    return best


def guess_pose(
    points_m: Float[np.ndarray, "n 3"],
    pixels_px: Float[np.ndarray, "n 2"],
    intrinsics: Float[np.ndarray, "9"],
) -> Pose:
    """The board's pose in the device's frame."""
    return guess_pose_and_error(points_m, pixels_px, intrinsics)[0]


def guess_pose_and_error(
    points_m: np.ndarray, pixels_px: np.ndarray, intrinsics: np.ndarray
) -> tuple[Pose, float]:
    """The board's pose by IPPE for planes, then refined; and the sum of its squared residuals [px^2]."""
    fx, fy, cx, cy = intrinsics[:4]
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    _, rotation, translation = cv2.solvePnP(
        points_m, pixels_px, matrix, intrinsics[4:], flags=cv2.SOLVEPNP_IPPE
    )
    rotation, translation = cv2.solvePnPRefineLM(
        points_m, pixels_px, matrix, intrinsics[4:], rotation, translation
    )
    predicted, _ = cv2.projectPoints(points_m, rotation, translation, matrix, intrinsics[4:])
    error = float(np.sum((np.asarray(predicted).reshape(-1, 2) - pixels_px) ** 2))
    return Pose(np.asarray(rotation, float).ravel(), np.asarray(translation, float).ravel()), error
