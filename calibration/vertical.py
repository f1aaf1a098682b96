"""Which way is up, in the camera's frame: a level board, a plumb line on the wall, or the camera."""

import cv2
import numpy as np
from jaxtyping import Float

from calibration.adjustment import Device
from calibration.record import Record, array_of
from calibration.wall import Plane, undistorted


def level_of(record: Record, camera: Device, plane: Plane | None) -> Float[np.ndarray, "3"]:
    """The upward direction; a camera that nothing else levels is taken to stand level itself."""
    if record.level is not None:
        points = array_of(record.level.points_m, 3)
        _, rotation, _ = cv2.solvePnP(
            points,
            array_of(record.level.camera_px, 2),
            camera.matrix,
            camera.intrinsics[4:],
            flags=cv2.SOLVEPNP_IPPE,
        )
        # A board's rows run downwards; a board hung upside down still shows the vertical.
        up = -cv2.Rodrigues(np.asarray(rotation, float))[0][:, 1]
        return up if up[1] < 0 else -up
    if record.placement.plumb_px is not None and plane is not None:
        u0, v0, u1, v1 = record.placement.plumb_px
        rays = undistorted(camera, np.array([[u0, v0], [u1, v1]]))
        lower, upper = rays * (plane.offset_m / (rays @ plane.normal))[:, None]
        return (upper - lower) / np.linalg.norm(upper - lower)
    return np.array([0.0, -1.0, 0.0])
