"""Is a set of board views good enough, and if not, which picture should be taken next, from where?"""

import cv2
import numpy as np
from jaxtyping import Bool, Float

from calibration.intrinsics import Intrinsics

CELLS = (6, 8)
ENOUGH_VIEWS = 8
ENOUGH_COVERAGE = 0.6
_TILT_RAD = 0.15
_SAME_RAD = 0.035
_WORST_TO_MEDIAN = 2.5
_FOCAL_STD = 0.002


def coverage(
    pixels_px: tuple[Float[np.ndarray, "_ 2"], ...], size_px: tuple[int, int]
) -> Bool[np.ndarray, "6 8"]:
    """Which cells of the picture have held a board point (rows from the top, columns from the left)."""
    seen = np.zeros(CELLS, bool)
    every = np.concatenate(pixels_px)
    column = np.clip((every[:, 0] / size_px[0] * CELLS[1]).astype(int), 0, CELLS[1] - 1)
    row = np.clip((every[:, 1] / size_px[1] * CELLS[0]).astype(int), 0, CELLS[0] - 1)
    seen[row, column] = True
    return seen


def advise(fit: Intrinsics, names: tuple[str, ...], size_px: tuple[int, int]) -> tuple[str, ...]:
    """What to retake or add, in the operator's words; empty if nothing."""
    advice = [*_count(names), *_repeats(fit, names), *_tilts(fit), *_cells(fit, size_px), *_worst(fit, names)]
    focal_std = float(fit.std[0] / fit.device.intrinsics[0])
    if focal_std > _FOCAL_STD:
        advice.append(
            f"The focal length is known to {100 * focal_std:.2f} % only; add views with the board tilted "
            "by 30 degrees and close enough to fill the picture."
        )
    if fit.outliers:
        advice.append(
            f"{fit.outliers} of the board points lie far off and were left out; check that the board is "
            "flat and no label or tape touches its squares."
        )
    return tuple(advice)


def _count(names: tuple[str, ...]) -> list[str]:
    if len(names) >= ENOUGH_VIEWS:
        return []
    return [f"{len(names)} views; take {ENOUGH_VIEWS} to 20, each with the board elsewhere and tilted."]


def _repeats(fit: Intrinsics, names: tuple[str, ...]) -> list[str]:
    """Pairs of views in which the board stands the same."""
    found = []
    poses = fit.adjusted.poses
    for i in range(len(poses)):
        for j in range(i + 1, len(poses)):
            a, b = (cv2.Rodrigues(poses[k].rotation_rad)[0] for k in (i, j))
            cosine = np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1)
            apart_m = float(np.linalg.norm(poses[i].translation_m - poses[j].translation_m))
            depth_m = float(np.linalg.norm(poses[i].translation_m))
            if np.arccos(cosine) < _SAME_RAD and apart_m < 0.02 * depth_m:
                found.append(f"{names[j]} repeats {names[i]}; retake it with the board elsewhere or tilted.")
    return found


def _tilts(fit: Intrinsics) -> list[str]:
    """Sides from which the board was never seen."""
    normals = np.array([cv2.Rodrigues(p.rotation_rad)[0][:, 2] for p in fit.adjusted.poses])
    # Turned towards the camera, so that a board's ordering of points does not matter.
    normals *= -np.sign(normals[:, 2:])
    advice = []
    for axis, one, other in ((0, "left", "right"), (1, "upper", "lower")):
        tilts = np.arcsin(np.clip(normals[:, axis], -1, 1))
        # A normal towards the left (-x) means that the board's right edge is the nearer one.
        if tilts.max() < _TILT_RAD:
            advice.append(
                f"Add views with the board's {one} edge turned towards the camera (20 to 40 degrees)."
            )
        if tilts.min() > -_TILT_RAD:
            advice.append(
                f"Add views with the board's {other} edge turned towards the camera (20 to 40 degrees)."
            )
    return advice


def _cells(fit: Intrinsics, size_px: tuple[int, int]) -> list[str]:
    seen = coverage(tuple(s.pixels_px for s in fit.sightings), size_px)
    if seen.mean() >= ENOUGH_COVERAGE:
        return []
    regions = {
        "upper left": seen[:3, :4],
        "upper right": seen[:3, 4:],
        "lower left": seen[3:, :4],
        "lower right": seen[3:, 4:],
    }
    poorest = sorted(regions, key=lambda name: float(regions[name].mean()))[:2]
    return [
        f"The boards cover {100 * seen.mean():.0f} % of the picture; add views in its {poorest[0]} and "
        f"{poorest[1]}."
    ]


def _worst(fit: Intrinsics, names: tuple[str, ...]) -> list[str]:
    rms = np.array(fit.view_rms_px)
    limit = _WORST_TO_MEDIAN * max(float(np.median(rms)), 0.05)
    return [
        f"Retake {names[i]}: it fits to {rms[i]:.2f} px, the others to {np.median(rms):.2f} px."
        for i in np.flatnonzero(rms > limit)
    ]
