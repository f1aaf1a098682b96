"""From the camera's frame to the world: y through the wall, z up in it, the origin where the operator says.

World axes are the room's: the back wall is the plane y = const, z is the direction within it nearest to
the vertical, x completes them (right-handed). Uncertainties are carried through by central differences.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from calibration.adjustment import Device
from calibration.wall import undistorted
from core.geometry import Optics, rotation_matrix, rotation_vector

Vector = Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Anchor:
    """A point of the wall seen at `pixel_px`, whose world x and z were measured; the wall's y.

    No pixel: the camera itself is at (x_m, z_m).
    """

    x_m: float = 0.0
    z_m: float = 0.0
    wall_y_m: float | None = None
    pixel_px: tuple[float, float] | None = None


@dataclass(frozen=True)
class WorldPose:
    """world = rotation @ (camera coordinates) + position_m."""

    rotation: Float[np.ndarray, "3 3"]
    position_m: Vector


def world_of(camera: Device, normal: Vector, offset_m: float, up: Vector, anchor: Anchor) -> WorldPose:
    """The world in which the plane normal . x = offset_m (camera frame) is y = const and `up` is up."""
    y_axis = normal / np.linalg.norm(normal)
    z_axis = up - (up @ y_axis) * y_axis
    z_axis = z_axis / np.linalg.norm(z_axis)
    rotation = np.stack([np.cross(y_axis, z_axis), y_axis, z_axis])
    known = np.zeros(3)
    if anchor.pixel_px is not None:
        ray = undistorted(camera, np.array([anchor.pixel_px]))[0]
        known = ray * offset_m / (normal @ ray)
    wall_y_m = offset_m if anchor.wall_y_m is None else anchor.wall_y_m
    seen = rotation @ known
    position = np.array([anchor.x_m - seen[0], wall_y_m - offset_m, anchor.z_m - seen[2]])
    return WorldPose(rotation, position)


def levelled(camera: Device) -> WorldPose:
    """The world before any wall is known: the camera at the origin, level, looking along +y."""
    return WorldPose(np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]), np.zeros(3))


def optics_in(world: WorldPose, device: Device, size_px: tuple[int, int]) -> Optics:
    """The device, whose pose is relative to the camera, as optics in the world."""
    device_from_camera = cv2.Rodrigues(np.asarray(device.rotation_rad, float))[0]
    centre = -device_from_camera.T @ device.translation_m
    x, y, z = world.rotation @ centre + world.position_m
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = map(float, device.intrinsics)
    return Optics(
        width_px=size_px[0],
        height_px=size_px[1],
        focal_px=(fx, fy),
        principal_px=(cx, cy),
        position_m=(float(x), float(y), float(z)),
        rotation_rad=rotation_vector(device_from_camera @ world.rotation.T),
        distortion=(k1, k2, p1, p2, k3),
    )


def difference(optics: Optics, reference: Optics) -> Float[np.ndarray, "15"]:
    """`optics` - `reference` in the order of `OPTICS_PARAMETERS`; rotations about the optics' own axes."""
    turned = optics.rotation @ reference.rotation.T
    values = [
        np.subtract(optics.focal_px, reference.focal_px),
        np.subtract(optics.principal_px, reference.principal_px),
        np.subtract(optics.distortion, reference.distortion),
        Rotation.from_matrix(turned).as_rotvec(),
        np.subtract(optics.position_m, reference.position_m),
    ]
    return np.concatenate(values)


def shifted(optics: Optics, change: Float[np.ndarray, "15"]) -> Optics:
    """`optics` changed by `change`: the inverse of `difference`."""
    x, y, z = np.array(optics.position_m) + change[12:]
    k1, k2, p1, p2, k3 = np.array(optics.distortion) + change[4:9]
    rx, ry, rz = change[9:12]
    return Optics(
        width_px=optics.width_px,
        height_px=optics.height_px,
        focal_px=(optics.focal_px[0] + change[0], optics.focal_px[1] + change[1]),
        principal_px=(optics.principal_px[0] + change[2], optics.principal_px[1] + change[3]),
        position_m=(x, y, z),
        rotation_rad=rotation_vector(rotation_matrix((rx, ry, rz)) @ optics.rotation),
        distortion=(k1, k2, p1, p2, k3),
    )
