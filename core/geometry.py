"""Boxes, walls and ideal optics.

World: right-handed, metres, z up. Optics: OpenCV axes (+z forward, +y down).
"""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float

from core.setting import SettingError, check_range, setting

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]
WallName = Literal["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"]
WALLS: tuple[WallName, ...] = get_args(WallName)


@setting
class Box:
    """The room: an axis-aligned box. The back wall, with the pattern, is its face y = upper_m[1]."""

    lower_m: Vector3
    """The corner with the smallest x, y and z; 0.001 to 500 m from the other along each."""
    upper_m: Vector3
    """The corner with the largest x, y and z; the patterned wall is at its y."""

    def __post_init__(self) -> None:
        for axis, lower, upper in zip("xyz", self.lower_m, self.upper_m, strict=True):
            if not (np.isfinite(lower) and np.isfinite(upper) and lower < upper):
                raise SettingError(
                    f"The room box has no extent along {axis}: {lower:g} to {upper:g} m. "
                    "Give lower_m below upper_m on every axis, in metres."
                )
        for axis, size in zip("xyz", self.size_m, strict=True):
            check_range(
                f"The room's extent along {axis}",
                size,
                1e-3,
                500.0,
                "m",
                "Were millimetres given for metres?",
            )

    @property
    def size_m(self) -> Vector3:
        """Extent along x, y, z."""
        sx, sy, sz = (u - low for low, u in zip(self.lower_m, self.upper_m, strict=True))
        return sx, sy, sz

    @property
    def centre_m(self) -> Vector3:
        """Centre point."""
        cx, cy, cz = ((u + low) / 2 for low, u in zip(self.lower_m, self.upper_m, strict=True))
        return cx, cy, cz


@dataclass(frozen=True)
class Face:
    """A wall as a side of the box: the axis of its normal, and whether it is that axis's upper end."""

    axis: int
    upper: bool

    @property
    def number(self) -> int:
        """Its place in `WALLS`."""
        return 2 * self.axis + self.upper

    @property
    def end(self) -> int:
        """Index of its plane in an array along its axis: 0 or -1."""
        return -1 if self.upper else 0

    @property
    def before(self) -> int:
        """Index of the plane in the room that is next to it: 1 or -2."""
        return -2 if self.upper else 1

    @property
    def inward(self) -> float:
        """Sign of a velocity along its axis that enters the room."""
        return -1.0 if self.upper else 1.0

    def straight_in(self, speed: float) -> Vector3:
        """The velocity of this speed that enters the room at right angles."""
        x, y, z = (self.inward * speed if axis == self.axis else 0.0 for axis in range(3))
        return x, y, z

    @property
    def along(self) -> tuple[int, int]:
        """The two axes of the wall, in the order x, y, z."""
        first, second = (a for a in range(3) if a != self.axis)
        return first, second

    def place_m(self, box: Box) -> float:
        """Where the wall stands on its axis."""
        return (box.upper_m if self.upper else box.lower_m)[self.axis]


def face_of(wall: str) -> Face:
    """The face of a wall by its name. Raises SettingError for a name that is no wall's."""
    if wall not in WALLS:
        raise SettingError(f"There is no wall {wall!r}; the walls are {', '.join(WALLS)}.")
    return Face("xyz".index(wall[0]), wall.endswith("max"))


@setting
class Optics:
    """A pinhole with Brown-Conrady distortion: a camera, or a projector as an inverse camera.

    `rotation_rad` is the Rodrigues vector of `optics_from_world`, so that a world point x has the
    optical coordinates R (x - position_m); `distortion` is OpenCV's (k1, k2, p1, p2, k3). Pixel (0, 0)
    is the centre of the first pixel. Source: OpenCV, "Camera Calibration and 3D Reconstruction".
    """

    width_px: int
    """Columns of the picture or panel."""
    height_px: int
    """Rows of the picture or panel."""
    focal_px: Vector2
    """Focal length over pixel pitch, along columns and rows."""
    principal_px: Vector2
    """Where the optical axis meets the picture: column, row."""
    position_m: Vector3
    """The lens in the room: x, y, z."""
    rotation_rad: Vector3
    """Rodrigues vector from the world's axes to the optics' (x right, y down, z forward)."""
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """OpenCV's k1, k2, p1, p2, k3."""

    def __post_init__(self) -> None:
        if self.width_px < 1 or self.height_px < 1:
            raise SettingError(
                f"Optics of {self.width_px} x {self.height_px} px; expected at least 1 x 1 px. "
                "Give width_px and height_px of the sensor or panel."
            )
        # A pinhole's picture beyond 170 degrees is no picture; 25 mm given for 5000 px has 178.
        least_px = 0.044 * max(self.width_px, self.height_px)
        for focal_px in self.focal_px:
            check_range(
                "Focal length", focal_px, least_px, 1e9, "px",
                "A focal length in px is f / pixel pitch (25 mm over 5 um is 5000 px). Were millimetres given?",
            )  # fmt: skip
        numbers = (*self.principal_px, *self.position_m, *self.rotation_rad, *self.distortion)
        if not np.isfinite(numbers).all():
            raise SettingError(
                f"Optics hold numbers that are not finite: principal_px {self.principal_px}, position_m "
                f"{self.position_m}, rotation_rad {self.rotation_rad}, distortion {self.distortion}. "
                "Give finite numbers; calibrate again if they came from a calibration."
            )

    @property
    def rotation(self) -> Float[np.ndarray, "3 3"]:
        """`optics_from_world` as a float64 matrix."""
        return rotation_matrix(self.rotation_rad)


def crop(optics: Optics, rows: slice, cols: slice) -> Optics:
    """The optics of a rectangle of the picture: the same rays, pixel (0, 0) at its corner."""
    cx, cy = optics.principal_px
    return replace(
        optics,
        width_px=cols.stop - cols.start,
        height_px=rows.stop - rows.start,
        principal_px=(cx - cols.start, cy - rows.start),
    )


def rotation_matrix(rotation_rad: Vector3) -> Float[np.ndarray, "3 3"]:
    """Rodrigues' formula, float64."""
    vector = np.asarray(rotation_rad, float)
    angle = float(np.linalg.norm(vector))
    cross = np.array(
        [[0.0, -vector[2], vector[1]], [vector[2], 0.0, -vector[0]], [-vector[1], vector[0], 0.0]]
    )
    # sinc forms are exact at angle 0.
    return (
        np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross
    )


def rotation_vector(matrix: Float[np.ndarray, "3 3"]) -> Vector3:
    """The inverse of `rotation_matrix`."""
    from scipy.spatial.transform import Rotation

    x, y, z = Rotation.from_matrix(matrix).as_rotvec()
    return float(x), float(y), float(z)


def looking_along_y(
    *,
    position_m: Vector3,
    width_px: int,
    height_px: int,
    focal_px: float,
    principal_px: Vector2 | None = None,
) -> Optics:
    """Optics at `position_m` looking along world +y with x to the right and z up in the picture."""
    centre = ((width_px - 1) / 2, (height_px - 1) / 2)
    return Optics(
        width_px=width_px,
        height_px=height_px,
        focal_px=(focal_px, focal_px),
        principal_px=principal_px or centre,
        position_m=position_m,
        # Rows are the optical axes in the world: x right = +x, y down = -z, z forward = +y.
        rotation_rad=rotation_vector(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])),
    )
