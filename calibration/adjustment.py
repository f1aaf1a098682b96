"""Bundle adjustment of cameras and projectors that see the same flat boards.

Unknown: each device's intrinsics, its pose relative to the first device, each board's pose. Minimised:
the sum of squared reprojection residuals over each device's (and each picture's) own standard deviation, by
Levenberg-Marquardt with OpenCV's analytic derivatives. Unlike OpenCV's routines it stops by the step
and not after 30 iterations, lets a principal point leave the picture (office projectors: offset
lenses), and returns the whole covariance. Cost a step: one
small product a sighting and one solve in all unknowns.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float

Vector = Float[np.ndarray, "3"]

# Distortion coefficients (k1, k2, p1, p2, k3) that each model leaves free, from lowest to highest order.
DISTORTION_MODELS: dict[str, tuple[bool, bool, bool, bool, bool]] = {
    "none": (False, False, False, False, False),
    "k1": (True, False, False, False, False),
    "k1 k2": (True, True, False, False, False),
    "k1 k2 p1 p2": (True, True, True, True, False),
    "k1 k2 p1 p2 k3": (True, True, True, True, True),
}


@dataclass(frozen=True)
class Device:
    """One camera or projector: (fx, fy, cx, cy, k1, k2, p1, p2, k3), what is free, pose from device 0."""

    intrinsics: Float[np.ndarray, "9"]
    free: Bool[np.ndarray, "9"]
    rotation_rad: Vector
    translation_m: Vector
    sigma_px: float = 1.0

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """OpenCV's camera matrix."""
        fx, fy, cx, cy = self.intrinsics[:4]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Sighting:
    """Board points [m] of view `view` and where device `device` has them [px].

    `noise_nd` is how much noisier than its device's `sigma_px` this picture is.
    """

    device: int
    view: int
    points_m: Float[np.ndarray, "points 3"]
    pixels_px: Float[np.ndarray, "points 2"]
    noise_nd: float = 1.0


@dataclass(frozen=True)
class Pose:
    """A board in the frame of device 0, as a Rodrigues vector and a translation."""

    rotation_rad: Vector
    translation_m: Vector


@dataclass(frozen=True)
class Adjusted:
    """The minimum: devices, board poses, residuals by sighting, covariance of the free device unknowns.

    `covariance` orders, device after device, the nine intrinsics and (from device 1 on) rotation and
    translation; fixed entries are zero.
    """

    devices: tuple[Device, ...]
    poses: tuple[Pose, ...]
    residuals_px: tuple[Float[np.ndarray, "_ 2"], ...]
    covariance: Float[np.ndarray, "unknowns unknowns"]
    iterations: int
    converged: bool

    def rms_px(self, sightings: tuple[Sighting, ...], device: int | None = None) -> float:
        """Root of the mean squared distance between seen and predicted points (as OpenCV counts it)."""
        chosen = [r for r, s in zip(self.residuals_px, sightings, strict=True) if device in (None, s.device)]
        return float(np.sqrt(np.mean(np.sum(np.concatenate(chosen) ** 2, axis=1))))


@dataclass(frozen=True)
class _Point:
    """Where the search stands: unknowns, weighted residuals by sighting, normal matrix and gradient."""

    unknowns: np.ndarray
    residuals: tuple[np.ndarray, ...]
    normal: np.ndarray
    gradient: np.ndarray

    @property
    def cost(self) -> float:
        return sum(float(r @ r) for r in self.residuals)


def adjust(
    devices: tuple[Device, ...],
    poses: tuple[Pose, ...],
    sightings: tuple[Sighting, ...],
    max_iterations: int = 500,
) -> Adjusted:
    """The least-squares devices and poses from this start."""
    free = _free(devices, len(poses))
    here = _linearise(_pack(devices, poses), devices, sightings)
    damping, iterations, converged = 1e-3, 0, False
    while iterations < max_iterations and not converged:
        iterations += 1
        trial = here.unknowns.copy()
        trial[free] += _step(here.normal[np.ix_(free, free)], here.gradient[free], damping, len(poses))
        # The start point may be poor: a focal length must not cross zero on the way.
        usable = all(d.intrinsics[:2].min() > 0 for d in _unpack(trial, devices)[0])
        there = _linearise(trial, devices, sightings) if usable else None
        if there is not None and there.cost <= here.cost:
            converged = here.cost - there.cost <= 1e-12 * here.cost
            here, damping = there, max(damping / 5, 1e-12)
        else:
            converged = damping > 1e9
            damping *= 4
    return _result(here, free, devices, sightings, iterations, converged)


def carried(adjusted: Adjusted, sightings: tuple[Sighting, ...]) -> Float[np.ndarray, "unknowns 9"]:
    """How the free unknowns of the devices follow the intrinsics of device 0, which were held, to first order.

    Rows as those of the covariance; zero where they are fixed.
    """
    devices, boards = adjusted.devices, len(adjusted.poses)
    known = (replace(devices[0], free=np.ones(9, bool)), *devices[1:])
    free = _free(known, boards)
    here = _linearise(_pack(devices, adjusted.poses), devices, sightings)
    reduced = _schur(here.normal[np.ix_(free, free)], boards)[0]
    found = np.zeros((_offset(len(devices)), 9))
    found[np.flatnonzero(free[: len(found)])[9:]] = -np.linalg.solve(reduced[9:, 9:], reduced[9:, :9])
    return found


def _linearise(unknowns: np.ndarray, devices: tuple[Device, ...], sightings: tuple[Sighting, ...]) -> _Point:
    """Residuals (predicted - seen, weighted); each sighting fills only its own block of the normal matrix."""
    now, poses = _unpack(unknowns, devices)
    normal, gradient = np.zeros((len(unknowns), len(unknowns))), np.zeros(len(unknowns))
    residuals = []
    for sighting in sightings:
        device = now[sighting.device]
        predicted, block = _project(sighting, device, poses[sighting.view])
        sigma_px = device.sigma_px * sighting.noise_nd
        residual = (predicted - sighting.pixels_px).ravel() / sigma_px
        block = block / sigma_px
        own = _offset(sighting.device)
        pose = _offset(len(devices)) + 6 * sighting.view
        where = np.r_[own : own + (15 if sighting.device else 9), pose : pose + 6]
        normal[np.ix_(where, where)] += block.T @ block
        gradient[where] += block.T @ residual
        residuals.append(residual)
    return _Point(unknowns, tuple(residuals), normal, gradient)


def _project(sighting: Sighting, device: Device, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Predicted pixels, and derivatives by intrinsics, the device's pose (if not device 0), the board's."""
    composed = cv2.composeRT(pose.rotation_rad, pose.translation_m, device.rotation_rad, device.translation_m)
    pixels, by = cv2.projectPoints(
        sighting.points_m, composed[0], composed[1], device.matrix, device.intrinsics[4:]
    )
    # OpenCV's columns: rotation 3, translation 3, focal 2, principal 2, distortion 5.
    blocks = [by[:, 6:15]]
    if sighting.device:
        blocks.append(by[:, :6] @ _stack(composed, 4, 5, 8, 9))
    blocks.append(by[:, :6] @ _stack(composed, 2, 3, 6, 7))
    return np.asarray(pixels, float).reshape(-1, 2), np.concatenate(blocks, axis=1)


def _stack(composed: tuple, rr: int, rt: int, tr: int, tt: int) -> np.ndarray:
    """The 6 x 6 derivative of the composed (rotation, translation) by one of the two."""
    by = np.empty((6, 6))
    by[:3, :3], by[:3, 3:], by[3:, :3], by[3:, 3:] = (composed[n] for n in (rr, rt, tr, tt))
    return by


def _step(normal: np.ndarray, gradient: np.ndarray, damping: float, boards: int) -> np.ndarray:
    """Solve the damped normal equations: the devices first, then each board's pose by itself."""
    scale = _scale(normal)
    scaled = normal / np.outer(scale, scale) + damping * np.eye(len(scale))
    right = -gradient / scale
    reduced, across, blocks = _schur(scaled, boards)
    own = len(reduced)
    eliminated = np.linalg.solve(blocks, right[own:].reshape(boards, 6, 1))
    step = np.linalg.solve(reduced, right[:own] - across @ eliminated.ravel())
    rest = np.linalg.solve(blocks, (right[own:] - across.T @ step).reshape(boards, 6, 1))
    return np.concatenate([step, rest.ravel()]) / scale


def _schur(normal: np.ndarray, boards: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The devices' normal matrix with the poses eliminated, the block beside it, and the poses' own blocks.

    No two boards share a residual, so their part of the matrix is one 6 x 6 block a board.
    """
    own = len(normal) - 6 * boards
    across, each = normal[:own, own:], np.arange(boards)
    blocks = normal[own:, own:].reshape(boards, 6, boards, 6)[each, :, each, :]
    carried = np.linalg.solve(blocks, across.T.reshape(boards, 6, own))
    return normal[:own, :own] - across @ carried.reshape(6 * boards, own), across, blocks


def _scale(normal: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.diag(normal))
    return np.where(scale == 0, 1.0, scale)


def _result(
    point: _Point,
    free: np.ndarray,
    devices: tuple[Device, ...],
    sightings: tuple[Sighting, ...],
    iterations: int,
    converged: bool,
) -> Adjusted:
    now, poses = _unpack(point.unknowns, devices)
    size = _offset(len(devices))
    normal = point.normal[np.ix_(free, free)]
    scale = _scale(normal)
    # A hair on the diagonal, for boards whose pose a wild start has left undetermined.
    scaled = normal / np.outer(scale, scale) + 1e-14 * np.eye(len(scale))
    reduced = _schur(scaled, len(poses))[0]
    own = free[:size]
    of_devices = scale[: len(reduced)]
    inverse = np.linalg.pinv(reduced, rcond=1e-14) / np.outer(of_devices, of_devices)
    degrees = max(sum(len(r) for r in point.residuals) - int(free.sum()), 1)
    covariance = np.zeros((size, size))
    covariance[np.ix_(own, own)] = point.cost / degrees * inverse
    pieces = tuple(
        r.reshape(-1, 2) * now[s.device].sigma_px * s.noise_nd
        for r, s in zip(point.residuals, sightings, strict=True)
    )
    return Adjusted(now, poses, pieces, covariance, iterations, converged)


def _offset(device: int) -> int:
    """Where a device's unknowns begin: device 0 has no pose of its own."""
    return 0 if device == 0 else 9 + 15 * (device - 1)


def _pack(devices: tuple[Device, ...], poses: tuple[Pose, ...]) -> np.ndarray:
    parts = [devices[0].intrinsics]
    for device in devices[1:]:
        parts += [device.intrinsics, device.rotation_rad, device.translation_m]
    for pose in poses:
        parts += [pose.rotation_rad, pose.translation_m]
    return np.concatenate(parts).astype(float)


def _unpack(unknowns: np.ndarray, devices: tuple[Device, ...]) -> tuple[tuple[Device, ...], tuple[Pose, ...]]:
    now = [replace(devices[0], intrinsics=unknowns[:9])]
    for number, device in enumerate(devices[1:], 1):
        own = unknowns[_offset(number) : _offset(number) + 15]
        now.append(replace(device, intrinsics=own[:9], rotation_rad=own[9:12], translation_m=own[12:]))
    rest = unknowns[_offset(len(devices)) :].reshape(-1, 6)
    return tuple(now), tuple(Pose(row[:3], row[3:]) for row in rest)


def _free(devices: tuple[Device, ...], poses: int) -> np.ndarray:
    flags = [devices[0].free]
    for device in devices[1:]:
        flags += [device.free, np.ones(6, bool)]
    return np.concatenate([*flags, np.ones(6 * poses, bool)])
