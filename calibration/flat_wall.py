"""Use the wall's flatness: camera, projector and plane adjusted until one plane explains the wall's code.

The boards' result enters as a Gaussian prior (its covariance), the wall's correspondences as residuals
in projector pixels. A wall is never quite flat and its bulges are alike over patches, so all the
correspondences together weigh no more than `INDEPENDENT` independent ones with their own scatter.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float

from calibration.adjustment import Adjusted, Device
from calibration.wall import Correspondences, Plane, fit_plane, triangulate, undistorted

INDEPENDENT = 200


@dataclass(frozen=True)
class FlatWall:
    """Devices and plane after the adjustment; `covariance` is of (devices' unknowns, plane n / offset).

    `rms_px` is the scatter of the wall's correspondences [projector px].
    """

    devices: tuple[Device, ...]
    plane: Plane
    covariance: Float[np.ndarray, "unknowns unknowns"]
    rms_px: float


def adjust_on_wall(adjusted: Adjusted, seen: Correspondences, iterations: int = 15) -> FlatWall:
    """Gauss-Newton on prior and wall together, from the boards' result."""
    camera, projector = adjusted.devices
    points_m, _ = triangulate(camera, projector, seen)
    plane = fit_plane(points_m)
    kept = Correspondences(seen.camera_px[plane.inliers], seen.projector_px[plane.inliers])
    start = np.concatenate([_pack(adjusted.devices), plane.normal / plane.offset_m])
    free = np.concatenate([np.diag(adjusted.covariance) > 0, [True, True, True]])
    prior = np.zeros((len(start), len(start)))
    known = np.flatnonzero(free[:-3])
    prior[np.ix_(known, known)] = _inverse(adjusted.covariance[np.ix_(known, known)])
    unknowns = start
    normal = np.eye(int(free.sum()))
    for _ in range(iterations):
        residual = _residual(unknowns, adjusted.devices, kept)
        scatter = float(np.sqrt(np.mean(residual**2)))
        sigma = scatter * np.sqrt(max(len(residual) / (2 * INDEPENDENT), 1.0))
        jacobian = _jacobian(unknowns, free, adjusted.devices, kept) / sigma
        normal = jacobian.T @ jacobian + prior[np.ix_(free, free)]
        gradient = jacobian.T @ residual / sigma + (prior @ (unknowns - start))[free]
        scale = np.sqrt(np.diag(normal))
        unknowns = unknowns.copy()
        unknowns[free] -= np.linalg.solve(normal / np.outer(scale, scale), gradient / scale) / scale
    return _result(unknowns, free, normal, adjusted.devices, seen, plane, kept)


def _result(
    unknowns: np.ndarray,
    free: np.ndarray,
    normal: np.ndarray,
    devices: tuple[Device, ...],
    seen: Correspondences,
    plane: Plane,
    kept: Correspondences,
) -> FlatWall:
    now = _unpack(unknowns, devices)
    points_m, _ = triangulate(now[0], now[1], seen)
    over_offset = unknowns[-3:]
    offset_m = 1.0 / float(np.linalg.norm(over_offset))
    direction = over_offset * offset_m
    distance = (points_m @ direction - offset_m)[plane.inliers]
    covariance = np.zeros((len(unknowns), len(unknowns)))
    covariance[np.ix_(free, free)] = _inverse(normal)
    fitted = Plane(
        normal=direction,
        offset_m=offset_m,
        flatness_rms_m=float(np.sqrt(np.mean(distance**2))),
        centre_m=points_m[plane.inliers].mean(axis=0) - distance.mean() * direction,
        inliers=plane.inliers,
    )
    residual = _residual(unknowns, devices, kept).reshape(-1, 2)
    return FlatWall(now, fitted, covariance, float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))))


def _residual(unknowns: np.ndarray, devices: tuple[Device, ...], seen: Correspondences) -> np.ndarray:
    """Projector pixels predicted through the plane, minus the decoded ones."""
    camera, projector = _unpack(unknowns, devices)
    rays = undistorted(camera, seen.camera_px)
    points_m = rays / (rays @ unknowns[-3:])[:, None]
    pixels, _ = cv2.projectPoints(
        points_m,
        projector.rotation_rad,
        projector.translation_m,
        projector.matrix,
        projector.intrinsics[4:],
    )
    return (np.asarray(pixels, float).reshape(-1, 2) - seen.projector_px).ravel()


def _jacobian(
    unknowns: np.ndarray, free: np.ndarray, devices: tuple[Device, ...], seen: Correspondences
) -> np.ndarray:
    """Central differences; steps in proportion to each unknown's natural size."""
    columns = []
    for index in np.flatnonzero(free):
        step = 1e-6 * max(abs(unknowns[index]), 0.1)
        ahead, behind = unknowns.copy(), unknowns.copy()
        ahead[index] += step
        behind[index] -= step
        columns.append((_residual(ahead, devices, seen) - _residual(behind, devices, seen)) / (2 * step))
    return np.stack(columns, axis=1)


def _inverse(matrix: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.diag(matrix))
    return np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-13) / np.outer(scale, scale)


def _pack(devices: tuple[Device, ...]) -> np.ndarray:
    camera, projector = devices
    return np.concatenate(
        [camera.intrinsics, projector.intrinsics, projector.rotation_rad, projector.translation_m]
    )


def _unpack(unknowns: np.ndarray, devices: tuple[Device, ...]) -> tuple[Device, Device]:
    camera, projector = devices
    return (
        replace(camera, intrinsics=unknowns[:9]),
        replace(
            projector,
            intrinsics=unknowns[9:18],
            rotation_rad=unknowns[18:21],
            translation_m=unknowns[21:24],
        ),
    )
