"""Which way is up, in the camera's frame: a level board, a plumb line on the wall, or the camera."""

from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float

from calibration.adjustment import Device
from calibration.record import Record, array_of
from calibration.wall import Plane, undistorted
from core.geometry import Optics

Edge = Literal["upper", "lower", "left", "right"]


def level_of(record: Record, camera: Device, plane: Plane | None) -> Float[np.ndarray, "3"]:
    """The upward direction; a camera that nothing else levels is taken to stand level itself.

    A board tells the vertical, but not which of its ends is up: it may hang upside down. The plumb line tells, and
    without one the picture does.
    """
    upwards = _plumb_line(record, camera, plane)
    if record.level is None:
        return upwards
    _, rotation, _ = cv2.solvePnP(
        array_of(record.level.points_m, 3),
        array_of(record.level.camera_px, 2),
        camera.matrix,
        camera.intrinsics[4:],
        flags=cv2.SOLVEPNP_IPPE,
    )
    # A board's rows run downwards.
    up = -cv2.Rodrigues(np.asarray(rotation, float))[0][:, 1]
    return up if up @ upwards > 0 else -up


def upper_edge(camera: Optics) -> Edge | None:
    """The edge of the picture that is up in the room; none where the camera looks up or down."""
    right, down, ahead = map(float, camera.rotation[:, 2])
    if abs(ahead) > max(abs(right), abs(down)):
        return None
    if abs(down) > abs(right):
        return "upper" if down < 0 else "lower"
    return "left" if right < 0 else "right"


def _plumb_line(record: Record, camera: Device, plane: Plane | None) -> Float[np.ndarray, "3"]:
    """From its lower to its upper end; up in the picture where there is none."""
    if record.placement.plumb_px is None or plane is None:
        return np.array([0.0, -1.0, 0.0])
    u0, v0, u1, v1 = record.placement.plumb_px
    rays = undistorted(camera, np.array([[u0, v0], [u1, v1]]))
    lower, upper = rays * (plane.offset_m / (rays @ plane.normal))[:, None]
    return (upper - lower) / np.linalg.norm(upper - lower)
