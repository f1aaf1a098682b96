"""From what was seen to the models: camera, projector, wall, world, each with its covariance.

    boards -> camera alone -> camera and projector -> wall -> world -> optics

Each arrow is taken as far as the record allows.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float

from calibration.adjustment import Device, Sighting
from calibration.advice import advise, coverage
from calibration.board import fixes_pose
from calibration.bundle import CalibratedOptics, CalibratedWall, Quality
from calibration.errors import CalibrationError, TooFewViewsError
from calibration.flat_wall import FlatWall, adjust_on_wall
from calibration.intrinsics import Intrinsics, fit_intrinsics
from calibration.pair import Pair, fit_pair
from calibration.record import Record, SeenBoard, array_of
from calibration.vertical import level_of
from calibration.views import ONE_ROW
from calibration.wall import Correspondences, Plane
from calibration.world import Anchor, WorldPose, difference, levelled, optics_in, world_of
from core.view_frame import turn_to

MINIMUM_VIEWS = 3
# Of the focal length; boards that all face the camera leave it open, and any one fits them.
MOST_FOCAL_STD = 0.1


@dataclass(frozen=True)
class Model:
    """All that follows from a record. `plane` is in the camera's frame; `world` places the camera."""

    record: Record
    camera: Intrinsics
    pair: Pair | None
    flat_wall: FlatWall | None
    plane: Plane | None
    world: WorldPose
    camera_optics: CalibratedOptics
    projector_optics: CalibratedOptics | None
    wall: CalibratedWall | None


@dataclass(frozen=True)
class _State:
    """Devices and plane with the covariance of (intrinsics, projector's intrinsics and pose, n / offset)."""

    devices: tuple[Device, ...]
    plane: Plane | None
    covariance: Float[np.ndarray, "unknowns unknowns"]


def build(record: Record) -> Model:
    """The models of a record.

    Raises:
        CalibrationError: fewer than three boards seen by the camera, a single row of one, or none of them tilted.
    """
    camera = _camera(record)
    pair = _pair(record, camera)
    state, flat = _state(record, camera, pair)
    up = level_of(record, state.devices[0], state.plane)
    world = _world(record, state, up)
    camera_optics, projector_optics = _optics(record, state, up, world)
    names = tuple(b.name for b in record.boards)
    quality = quality_of(camera, advise(camera, names, record.camera_size_px), record.camera_size_px)
    calibrated = CalibratedOptics(record.camera, camera_optics[0], camera_optics[1], quality=quality)
    projector = None
    if pair is not None and projector_optics is not None and record.panel_size_px is not None:
        lit = tuple(b.name for b in record.boards if b.panel_px)
        advice = advise(pair.projector, lit, record.panel_size_px)
        projector = CalibratedOptics(
            "projector", *projector_optics, quality=quality_of(pair.projector, advice, record.panel_size_px)
        )
    wall = _calibrated_wall(record, state, flat, world)
    return Model(record, camera, pair, flat, state.plane, world, calibrated, projector, wall)


def _camera(record: Record) -> Intrinsics:
    if len(record.boards) < MINIMUM_VIEWS:
        raise TooFewViewsError(
            f"{len(record.boards)} usable board views; expected at least {MINIMUM_VIEWS}, better 8 to 20. "
            "Take more, each with the board elsewhere and tilted; those found so far are kept."
        )
    sightings = tuple(
        Sighting(0, i, array_of(b.points_m, 3), array_of(b.camera_px, 2)) for i, b in enumerate(record.boards)
    )
    for board, sighting in zip(record.boards, sightings, strict=True):
        if not fixes_pose(sighting.points_m):
            raise CalibrationError(f"{board.name}: {ONE_ROW}")
    fit = fit_intrinsics(sightings, record.camera_size_px)
    focal_std = float(fit.std[0] / fit.device.intrinsics[0])
    if not focal_std <= MOST_FOCAL_STD:
        raise TooFewViewsError(
            f"The focal length is known to {100 * focal_std:.0f} % only; expected {100 * MOST_FOCAL_STD:.0f} % or "
            "better. Add views with the board tilted by 30 degrees, to every side: boards that face the camera tell "
            "nothing of it."
        )
    return fit


def _pair(record: Record, camera: Intrinsics) -> Pair | None:
    lit = [(i, b) for i, b in enumerate(record.boards) if b.panel_px]
    if len(lit) < MINIMUM_VIEWS or record.panel_size_px is None:
        return None
    sightings = tuple(Sighting(1, i, array_of(b.panel_points_m, 3), array_of(b.panel_px, 2)) for i, b in lit)
    return fit_pair(camera, sightings, record.panel_size_px)


def _state(record: Record, camera: Intrinsics, pair: Pair | None) -> tuple[_State, FlatWall | None]:
    """The best knowledge of devices and plane."""
    if pair is not None and record.wall is not None:
        seen = Correspondences(array_of(record.wall.camera_px, 2), array_of(record.wall.panel_px, 2))
        flat = adjust_on_wall(pair.adjusted, seen)
        return _State(flat.devices, flat.plane, flat.covariance), flat
    adjusted = camera.adjusted if pair is None else pair.adjusted
    devices = adjusted.devices
    size = len(adjusted.covariance)
    covariance = np.zeros((size + 3, size + 3))
    covariance[:size, :size] = adjusted.covariance
    plane = None
    if record.level is not None:
        plane, covariance[size:, size:] = board_plane(record.level, devices[0])
    return _State(devices, plane, covariance), None


def board_plane(board: SeenBoard, camera: Device) -> tuple[Plane, Float[np.ndarray, "3 3"]]:
    """The plane of a board held flat against the wall, and the covariance of n / offset."""
    points, pixels = array_of(board.points_m, 3), array_of(board.camera_px, 2)
    _, rotation, translation = cv2.solvePnP(
        points, pixels, camera.matrix, camera.intrinsics[4:], flags=cv2.SOLVEPNP_IPPE
    )
    rotation, translation = cv2.solvePnPRefineLM(
        points, pixels, camera.matrix, camera.intrinsics[4:], rotation, translation
    )
    predicted, by = cv2.projectPoints(points, rotation, translation, camera.matrix, camera.intrinsics[4:])
    left = np.asarray(predicted).reshape(-1, 2) - pixels
    sigma = float(np.sqrt(np.sum(left**2) / (left.size - 6)))
    pose = np.concatenate([np.ravel(rotation), np.ravel(translation)])
    slopes = np.stack([(_over(pose + d) - _over(pose - d)) / 2e-6 for d in 1e-6 * np.eye(6)], axis=1)
    covariance = slopes @ np.linalg.inv(by[:, :6].T @ by[:, :6]) @ slopes.T * sigma**2
    over = _over(pose)
    offset_m = 1.0 / float(np.linalg.norm(over))
    centre = cv2.Rodrigues(pose[:3])[0] @ points.mean(axis=0) + pose[3:]
    return Plane(over * offset_m, offset_m, 0.0, centre, np.ones(len(points), bool)), covariance


def _over(pose: np.ndarray) -> np.ndarray:
    """n / offset of a board's plane."""
    normal = cv2.Rodrigues(pose[:3])[0][:, 2]
    return normal / (normal @ pose[3:])


def _world(record: Record, state: _State, up: np.ndarray) -> WorldPose:
    """The camera in the room: found in the view's own frame, where its wall is y_max, and turned back."""
    place = record.placement
    if state.plane is None:
        found = levelled(state.devices[0])
    else:
        anchor = Anchor(place.x_m, place.z_m, place.wall_y_m, place.anchor_px)
        found = world_of(state.devices[0], state.plane.normal, state.plane.offset_m, up, anchor)
    turn = turn_to(place.wall)
    if turn.is_none:
        return found
    return WorldPose(turn.matrix.T @ found.rotation, turn.matrix.T @ found.position_m)


def _optics(record: Record, state: _State, up: np.ndarray, world: WorldPose) -> tuple[tuple, tuple | None]:
    """(optics, covariance) of the camera; (optics, covariance, cross) of the projector."""
    sizes = [record.camera_size_px, record.panel_size_px or (1, 1)]
    now = [optics_in(world, d, s) for d, s in zip(state.devices, sizes, strict=False)]
    columns = []
    free = np.flatnonzero(np.diag(state.covariance) > 0)
    for index in free:
        step = 1e-3 * float(np.sqrt(state.covariance[index, index]))
        ends = []
        for sign in (1.0, -1.0):
            moved = _moved(state, int(index), sign * step)
            there = _world(record, moved, up)
            pairs = zip(moved.devices, sizes, now, strict=False)
            ends.append(np.concatenate([difference(optics_in(there, d, s), n) for d, s, n in pairs]))
        columns.append((ends[0] - ends[1]) / (2 * step))
    slopes = np.stack(columns, axis=1)
    whole = slopes @ state.covariance[np.ix_(free, free)] @ slopes.T
    camera = (now[0], rows(whole[:15, :15]))
    return camera, (now[1], rows(whole[15:, 15:]), rows(whole[15:, :15])) if len(now) > 1 else None


def _moved(state: _State, index: int, step: float) -> _State:
    """The state with one unknown moved."""
    devices, size = list(state.devices), len(state.covariance) - 3
    change = np.zeros(len(state.covariance))
    change[index] = step
    devices[0] = replace(devices[0], intrinsics=devices[0].intrinsics + change[:9])
    if size > 9:
        other = devices[1]
        devices[1] = replace(
            other,
            intrinsics=other.intrinsics + change[9:18],
            rotation_rad=other.rotation_rad + change[18:21],
            translation_m=other.translation_m + change[21:24],
        )
    plane = state.plane
    if plane is not None:
        over = plane.normal / plane.offset_m + change[size:]
        offset_m = 1.0 / float(np.linalg.norm(over))
        plane = replace(plane, normal=over * offset_m, offset_m=offset_m)
    return _State(tuple(devices), plane, state.covariance)


def _calibrated_wall(
    record: Record, state: _State, flat: FlatWall | None, world: WorldPose
) -> CalibratedWall | None:
    plane = state.plane
    if plane is None:
        return None
    covariance = state.covariance[-3:, -3:]
    along = plane.normal * plane.offset_m**2
    offset_std = float(np.sqrt(along @ covariance @ along))
    across = np.linalg.svd(plane.normal[None])[2][1:] * plane.offset_m
    tilt_std = float(np.sqrt(np.max(np.linalg.eigvalsh(across @ covariance @ across.T))))
    centre = world.rotation @ plane.centre_m + world.position_m
    normal = world.rotation @ plane.normal
    x, y, z = map(float, centre)
    nx, ny, nz = map(float, normal)
    issues = () if record.wall is None else record.wall.issues
    quality = Quality("measured", 0.0 if flat is None else flat.rms_px, 1, 1.0, issues)
    return CalibratedWall(
        (x, y, z), (nx, ny, nz), plane.flatness_rms_m, offset_std, tilt_std, int(plane.inliers.sum()), quality
    )


def quality_of(fit: Intrinsics, advice: tuple[str, ...], size_px: tuple[int, int]) -> Quality:
    """How good a device's fit is."""
    share = float(coverage(tuple(s.pixels_px for s in fit.sightings), size_px).mean())
    return Quality("measured", fit.rms_px, len(fit.sightings), share, advice)


def rows(matrix: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """A matrix as a bundle keeps it."""
    return tuple(tuple(map(float, row)) for row in matrix)
