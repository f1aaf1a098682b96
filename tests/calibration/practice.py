"""A rig whose truth is known, and a real camera's noise, for the calibration's tests."""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.board import Board
from calibration.simulated_pictures import Sheet
from core.geometry import Optics, looking_along_y, rotation_vector

# World axes of a board that faces the camera: x right, y down, normal away from the camera.
FACING = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])


def turned(optics: Optics, xyz_rad: tuple[float, float, float]) -> Optics:
    """Optics turned about their own axes."""
    rotation = Rotation.from_euler("xyz", xyz_rad).as_matrix() @ optics.rotation
    return dataclasses.replace(optics, rotation_rad=rotation_vector(rotation))


def rig(scale: float = 1.0) -> tuple[Optics, Optics]:
    """A camera with lens distortion and a shifted projector whose principal point is off its panel."""
    camera = looking_along_y(
        position_m=(0.0, 0.0, 1.2),
        width_px=int(1280 * scale),
        height_px=int(1024 * scale),
        focal_px=1900.0 * scale,
        principal_px=(652.3 * scale, 498.7 * scale),
    )
    camera = dataclasses.replace(camera, distortion=(-0.12, 0.08, 0.0006, -0.0004, 0.0))
    projector = looking_along_y(
        position_m=(0.55, 0.1, 0.75),
        width_px=int(1280 * scale),
        height_px=int(800 * scale),
        focal_px=1750.0 * scale,
        principal_px=(640.0 * scale, 830.0 * scale),
    )
    projector = dataclasses.replace(projector, distortion=(-0.05, 0.03, 0.0, 0.0, 0.0))
    return turned(camera, (0.02, -0.03, 0.01)), turned(projector, (0.05, 0.16, -0.02))


def wall(distance_m: float = 3.0) -> Sheet:
    """A wall across the view, oblique by 8 degrees and leaning by 1."""
    frame = Rotation.from_euler("xyz", [1.0, 0.0, 8.0], degrees=True).as_matrix() @ FACING
    return Sheet(np.full((4, 4), 0.8, np.float32), 1.0, np.array([0.0, distance_m, 1.2]), frame, 0.8)


# Places (x, y, z) and turns (degrees) of a board about a rig at height 1.2 m.
STANDS = (
    ((0.0, 2.6, 1.2), (0, 0, 0)),
    ((-0.35, 2.4, 1.4), (25, 0, 5)),
    ((0.35, 2.4, 1.0), (-25, 0, -5)),
    ((-0.3, 2.6, 1.05), (0, 25, 0)),
    ((0.3, 2.6, 1.35), (0, -25, 10)),
    ((0.0, 2.2, 1.2), (20, 20, 90)),
    ((0.25, 2.5, 1.4), (-20, 20, 0)),
    ((-0.25, 2.5, 1.0), (20, -20, 0)),
    ((0.0, 2.4, 1.3), (-20, -20, 180)),
    ((0.4, 2.7, 1.4), (30, 0, 0)),
    ((-0.4, 2.7, 1.0), (-30, 0, 5)),
    ((0.0, 2.0, 1.0), (0, 30, 3)),
)


def standing(board: Board, centre_m: tuple, turn_deg: tuple, px_per_square: int = 40) -> Sheet:
    """The board's print at a place, turned about its own axes."""
    print_out = board.draw(px_per_square)
    step_m = board.spacing_m if hasattr(board, "spacing_m") else board.square_m
    frame = FACING @ Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    size_m = np.array(print_out.shape[::-1]) / px_per_square * step_m
    corner = np.array(centre_m) - frame[:, :2] @ (size_m / 2)
    return Sheet(print_out, px_per_square / step_m, corner, frame)


def exposed(luminance: np.ndarray, rng: np.random.Generator, bits: int = 10, frames: int = 1) -> np.ndarray:
    """Counts of a 10-bit camera: 10 ke- full well, 5 e- read noise, dark 16, 80 % exposed."""
    electrons = np.asarray(luminance, np.float32) * np.float32(8000.0)
    full = 2**bits - 1
    total = np.zeros(electrons.shape, np.float32)
    for _ in range(frames):
        scatter = np.sqrt(electrons + 25.0) * rng.standard_normal(electrons.shape, np.float32)
        total += np.clip(np.rint((electrons + scatter) * ((full - 16) / 1e4) + 16), 0, full)
    return total.astype(np.uint16) if frames == 1 else total / frames


def project(optics: Optics, points_m: np.ndarray) -> np.ndarray:
    """World points to pixels by the textbook formula, independent of OpenCV."""
    x, y, z = optics.rotation @ (points_m - np.array(optics.position_m)).T
    x, y = x / z, y / z
    k1, k2, p1, p2, k3 = optics.distortion
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([u, v], axis=1) * optics.focal_px + optics.principal_px
