"""What a calibration hands on: models of camera, projector, wall and response, with how well each is known.

Text in, text out; the caller does the files. Lengths in metres, angles in radians, image positions in
pixels (0, 0 = centre of the first pixel), counts as the camera gives them. A bundle may be partial:
every part is kept as soon as it is known, and the parts that a step needs are asked for by name.
"""

import dataclasses
import datetime as dt
import json
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from calibration import strict
from calibration.errors import BundleError
from core.geometry import Optics, Vector3
from core.scene import CameraNoise

SCHEMA = 1

# The order of rows and columns in an optics covariance.
OPTICS_PARAMETERS = (
    "focal_x_px",
    "focal_y_px",
    "principal_x_px",
    "principal_y_px",
    "k1",
    "k2",
    "p1",
    "p2",
    "k3",
    "rotation_x_rad",
    "rotation_y_rad",
    "rotation_z_rad",
    "position_x_m",
    "position_y_m",
    "position_z_m",
)

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Quality:
    """How good a part is. `given` was typed in or simulated, `measured` came out of images."""

    source: Literal["given", "measured"] = "given"
    reprojection_rms_px: float = 0.0
    views: int = 0
    coverage: float = 0.0
    advice: tuple[str, ...] = ()


@dataclass(frozen=True)
class CalibratedOptics:
    """A camera or projector in the world. `covariance` is in the order of `OPTICS_PARAMETERS`; none = exact.

    The projector's `cross_covariance` is with the first camera: their poses err together.
    Rotation rows are small rotations about the optics' own axes (left multiplied to
    `optics_from_world`), not increments of the Rodrigues vector.
    """

    name: str
    optics: Optics
    covariance: Rows | None = None
    cross_covariance: Rows | None = None
    quality: Quality = Quality()

    def __post_init__(self) -> None:
        size = len(OPTICS_PARAMETERS)
        for matrix in (self.covariance, self.cross_covariance):
            if matrix is not None and [len(row) for row in matrix] != [size] * size:
                raise BundleError(
                    f"The covariance of {self.name!r} is not {size} x {size}; "
                    "expected one row and column for each optics parameter. Calibrate again."
                )

    def covariance_matrix(self) -> Float[np.ndarray, "15 15"]:
        """The covariance as an array; zeros where the optics are exact."""
        return _matrix(self.covariance)

    def cross_covariance_matrix(self) -> Float[np.ndarray, "15 15"]:
        """Covariance of these optics (rows) with the first camera (columns); zeros where unknown."""
        return _matrix(self.cross_covariance)


@dataclass(frozen=True)
class CalibratedWall:
    """The back wall as a plane {x: normal . (x - point_m) = 0}; `flatness_rms_m` is its scatter about it."""

    point_m: Vector3
    normal: Vector3
    flatness_rms_m: float = 0.0
    offset_std_m: float = 0.0
    tilt_std_rad: float = 0.0
    points: int = 0
    quality: Quality = Quality()


@dataclass(frozen=True)
class CameraResponse:
    """Linear response and noise of one camera: counts = dark + gain * electrons, per frame.

    `linearity` holds (light, response) pairs in 0..1 (empty: linear within `nonlinearity`);
    `flat_field` names an image beside the bundle.
    """

    name: str
    bits: int
    dark_counts: float
    gain_counts_per_e: float
    read_noise_e: float
    full_well_e: float
    linearity: tuple[tuple[float, float], ...] = ()
    nonlinearity: float = 0.0
    gain_std_counts_per_e: float = 0.0
    read_noise_std_e: float = 0.0
    flat_field: str | None = None
    quality: Quality = Quality()

    @property
    def noise(self) -> CameraNoise:
        """The noise model that capture simulation and reconstruction use."""
        return CameraNoise(
            full_well_e=self.full_well_e,
            read_noise_e=self.read_noise_e,
            dark_counts=self.dark_counts,
            bits=self.bits,
        )


@dataclass(frozen=True)
class ProjectorResponse:
    """Luminance of the projector against grey level, both 0..1; `gamma` is the best single exponent."""

    levels: tuple[float, ...]
    luminance: tuple[float, ...]
    gamma: float
    black_level: float = 0.0


@dataclass(frozen=True)
class FurtherView:
    """What was calibrated with the camera of that name, which is not the scene's first: its projector and wall."""

    name: str
    projector: CalibratedOptics | None = None
    wall: CalibratedWall | None = None
    projector_response: ProjectorResponse | None = None


@dataclass(frozen=True)
class Joint:
    """Devices of several views that were adjusted together: how they err with one another.

    `parts` names them, cameras by their names and projectors as "projector of <camera>"; `covariance` has the rows
    and columns of `OPTICS_PARAMETERS` for each part in turn. `boards` were seen by several cameras at once, with
    the residual `rms_px`.
    """

    parts: tuple[str, ...]
    covariance: Rows
    boards: int = 0
    rms_px: float = 0.0

    def __post_init__(self) -> None:
        size = len(OPTICS_PARAMETERS) * len(self.parts)
        if [len(row) for row in self.covariance] != [size] * size:
            raise BundleError(
                f"The joint covariance of {len(self.parts)} devices is not {size} x {size}. Adjust them together "
                "again: airlens calibrate together."
            )

    def covariance_of(self, *parts: str) -> Float[np.ndarray, "rows cols"]:
        """The rows and columns of these parts, in this order. Raises BundleError for a part that it lacks."""
        missing = [part for part in parts if part not in self.parts]
        if missing:
            raise BundleError(
                f"{', '.join(map(repr, missing))} was not adjusted together with the others; known are "
                f"{', '.join(map(repr, self.parts))}."
            )
        size = len(OPTICS_PARAMETERS)
        which = np.concatenate([size * self.parts.index(part) + np.arange(size) for part in parts])
        return np.array(self.covariance, float)[np.ix_(which, which)]


@dataclass(frozen=True)
class Bundle:
    """One calibration: the cameras, the projector, the wall, the responses.

    `projector`, `wall` and `projector_response` are those of the scene's first view; `further` holds those of the
    others. `joint` is there while the views stand as they were adjusted together. `images` maps the name of each
    image used to its SHA-256; `ambient_temperature_k` and `minutes_on` say how warm room and devices were.
    """

    date: str
    cameras: tuple[CalibratedOptics, ...] = ()
    projector: CalibratedOptics | None = None
    wall: CalibratedWall | None = None
    camera_responses: tuple[CameraResponse, ...] = ()
    projector_response: ProjectorResponse | None = None
    ambient_temperature_k: float | None = None
    minutes_on: float | None = None
    further: tuple[FurtherView, ...] = ()
    joint: Joint | None = None
    images: dict[str, str] = field(default_factory=dict)
    units: str = "m, rad, px, counts, e, K"
    schema: int = SCHEMA

    def __post_init__(self) -> None:
        if self.schema != SCHEMA:
            raise BundleError(
                f"The bundle has schema {self.schema}; this version reads {SCHEMA}. "
                "Calibrate again, or use the version of airlens that wrote it."
            )
        try:
            aware = dt.datetime.fromisoformat(self.date).tzinfo is not None
        except ValueError:
            aware = False
        if not aware:
            raise BundleError(
                f"The bundle's date is {self.date!r}; expected ISO 8601 with a time zone, "
                "such as 2026-03-01T12:00:00+00:00."
            )

    def camera(self, name: str | None = None) -> CalibratedOptics:
        """The camera called `name`, or the only (first) one.

        Raises:
            BundleError: no such camera.
        """
        for camera in self.cameras:
            if name is None or camera.name == name:
                return camera
        known = ", ".join(repr(c.name) for c in self.cameras) or "none"
        raise BundleError(
            f"The calibration has no camera {name or ''!r} (known: {known}); run 'airlens calibrate camera'."
        )

    def response(self, name: str | None = None) -> CameraResponse | None:
        """The response of the camera called `name` (or the first one), if it was measured."""
        return next((r for r in self.camera_responses if name is None or r.name == name), None)

    def of(self, camera: str, is_first: bool) -> "Bundle":
        """What concerns one view: its camera, response, projector and wall, in the first view's places."""
        own = (
            self
            if is_first
            else next((one for one in self.further if one.name == camera), FurtherView(camera))
        )
        return dataclasses.replace(
            self,
            cameras=tuple(one for one in self.cameras if one.name == camera),
            camera_responses=tuple(one for one in self.camera_responses if one.name == camera),
            projector=own.projector,
            wall=own.wall,
            projector_response=own.projector_response,
            further=(),
            joint=None,
        )

    def with_view(self, camera: str, is_first: bool, **parts: Any) -> "Bundle":
        """This bundle with parts of a view (projector, wall, projector_response) in place of those it had."""
        if is_first:
            return dataclasses.replace(self, **parts)
        own = next((one for one in self.further if one.name == camera), FurtherView(camera))
        return dataclasses.replace(self, further=_put(self.further, dataclasses.replace(own, **parts)))

    def with_camera(self, camera: CalibratedOptics) -> "Bundle":
        """This bundle with `camera` in place of its namesake, or added."""
        return dataclasses.replace(self, cameras=_put(self.cameras, camera))

    def with_response(self, response: CameraResponse) -> "Bundle":
        """This bundle with `response` in place of its namesake, or added."""
        return dataclasses.replace(self, camera_responses=_put(self.camera_responses, response))


def given_bundle(
    *,
    date: str,
    cameras: dict[str, Optics],
    projector: Optics | None = None,
    noise: dict[str, CameraNoise] | None = None,
    back_wall_y_m: float | None = None,
    further: tuple[FurtherView, ...] = (),
) -> Bundle:
    """A bundle of quality `given` from optics that are known, as a simulated rig's are.

    The wall is the plane y = `back_wall_y_m`; `noise` by camera name becomes the camera responses.
    """
    wall = None
    if back_wall_y_m is not None:
        wall = CalibratedWall(point_m=(0.0, back_wall_y_m, 0.0), normal=(0.0, 1.0, 0.0))
    return Bundle(
        date=date,
        cameras=tuple(CalibratedOptics(name, optics) for name, optics in cameras.items()),
        projector=None if projector is None else CalibratedOptics("projector", projector),
        wall=wall,
        camera_responses=tuple(given_response(name, n) for name, n in (noise or {}).items()),
        further=further,
    )


def given_response(name: str, noise: CameraNoise) -> CameraResponse:
    """The response that the noise model `noise` implies: full well at full scale."""
    full_scale = 2**noise.bits - 1 - noise.dark_counts
    return CameraResponse(
        name=name,
        bits=noise.bits,
        dark_counts=noise.dark_counts,
        gain_counts_per_e=full_scale / noise.full_well_e,
        read_noise_e=noise.read_noise_e,
        full_well_e=noise.full_well_e,
    )


def to_json(bundle: Bundle) -> str:
    """The bundle as JSON text."""
    return json.dumps(strict.encode(bundle), indent=1, allow_nan=False) + "\n"


def from_json(text: str, source: str = "bundle.json") -> Bundle:
    """The bundle in JSON text; `source` names it in messages.

    Raises:
        BundleError: not JSON, an unknown or missing key, a wrong type, another schema.
    """
    return strict.from_json(Bundle, text, source, "Restore it from its copy, or calibrate again.")


def _matrix(rows: Rows | None) -> Float[np.ndarray, "15 15"]:
    size = len(OPTICS_PARAMETERS)
    return np.zeros((size, size)) if rows is None else np.array(rows, float)


def _put(items: tuple[Any, ...], new: Any) -> tuple[Any, ...]:
    """`items` with `new` in place of its namesake, or at the end."""
    if any(item.name == new.name for item in items):
        return tuple(new if item.name == new.name else item for item in items)
    return (*items, new)
