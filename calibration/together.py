"""Several views in one room: what ties their devices, the walls that they see, and what was measured by tape.

    each view alone -> devices tied by what they share -> walls, levels and tape of all -> optics in the room

Each view alone takes its wall, its level and its tape as exact, so that two views err apart by whatever these are
wrong by. Here each counts with its standard deviation. The tied devices enter as a Gaussian (their covariance), the
walls' Gray code as residuals in projector pixels; scipy's least squares finds the rest.
"""

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from calibration.adjustment import Device
from calibration.bundle import CalibratedOptics, CalibratedWall, Joint
from calibration.errors import CalibrationError
from calibration.flat_wall import INDEPENDENT
from calibration.model import Model, board_plane, rows
from calibration.record import array_of
from calibration.shared import SharedBoard
from calibration.tie import Seat, Tied, tie
from calibration.vertical import level_of
from calibration.wall import Plane, undistorted
from calibration.world import WorldPose, difference, optics_in
from core.geometry import Optics, WallName, rotation_matrix
from core.view_frame import turn_to

Vector = Float[np.ndarray, "3"]

# A dozen numbers are stated of two views: by chance one is beyond four deviations in one calibration of a thousand.
DOUBTED = 4.0


@dataclass(frozen=True)
class Stated:
    """Standard deviations of what an operator states of a room.

    `tape_std_m`: a coordinate of a camera or a wall. A tape of EU class II is true to 1 mm over 4 m; where in a
    lens the light crosses is judged to some 5 mm.
    `square_std_rad`: the angle of a room's walls. DIN 18202 (table 2) lets an edge of 3 to 6 m be off by 12 mm;
    evenly spread, that is 12 mm / sqrt(3) over 4.5 m.
    `level_std_rad`: a board held level. Makers of spirit levels state 0.5 mm/m.
    """

    tape_std_m: float = 0.005
    square_std_rad: float = 0.0015
    level_std_rad: float = 0.0005

    def __post_init__(self) -> None:
        for name in ("tape_std_m", "square_std_rad", "level_std_rad"):
            if not getattr(self, name) > 0:
                raise CalibrationError(
                    f"{name} is {getattr(self, name):g}; expected a standard deviation above 0: nothing is exact."
                )


@dataclass(frozen=True)
class ViewTogether:
    """One view after the common adjustment, as a bundle keeps it."""

    camera: CalibratedOptics
    projector: CalibratedOptics | None
    wall: CalibratedWall | None


@dataclass(frozen=True)
class Together:
    """All views by their cameras' names, and the covariance of their devices with one another.

    `contradictions` are sentences on what was stated of the room and what the pictures do not bear out.
    """

    views: dict[str, ViewTogether]
    joint: Joint
    tied: Tied
    contradictions: tuple[str, ...] = ()


def adjust_together(
    seats: tuple[Seat, ...],
    shared: tuple[SharedBoard, ...],
    stated: Stated | None = None,
) -> Together:
    """The views of `seats` in one room.

    Raises:
        NothingSharedError: nothing ties a view to the others.
        CalibrationError: no view has found its wall, so that nothing ties the rig to the room.
    """
    if not any(seat.model.plane is not None for seat in seats):
        raise CalibrationError(
            "No view has found its wall, so nothing ties the cameras to the room. Take the step 'wall' with one of "
            "them at least, then adjust them together."
        )
    room = _Room(tie(seats, shared), stated or Stated())
    solved = least_squares(
        room.residuals,
        np.zeros(room.size),
        jac="3-point",
        method="trf",
        x_scale="jac",
        xtol=1e-12,
        ftol=1e-12,
    )
    return room.result(solved.x, _inverse_of(solved.jac))


@dataclass(frozen=True)
class _Here:
    """Where a search stands: devices from the first camera, planes by wall (n / offset, in the frame of the camera
    that was the first to see it), and the first camera in the room."""

    devices: tuple[Device, ...]
    planes: dict[WallName, Vector]
    world: WorldPose


@dataclass
class _Room:
    """The last adjustment. Its unknowns are changes: free ones of the devices, planes, the first camera's pose."""

    tied: Tied
    stated: Stated
    owners: dict[WallName, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        adjusted, seats = self.tied.adjusted, self.tied.seats
        self._free = np.flatnonzero(np.diag(adjusted.covariance) > 0)
        self._whiten = _whitening(adjusted.covariance[np.ix_(self._free, self._free)])
        for number, seat in enumerate(seats):
            wall = seat.model.record.placement.wall
            lit = seat.model.flat_wall is not None
            owner = self.owners.get(wall)
            if seat.model.plane is not None and (owner is None or (lit and not self._is_lit(owner))):
                self.owners[wall] = number
        self._boards = {
            n: _board_on_wall(seat.model) for n, seat in enumerate(seats) if seat.model.plane is not None
        }
        self._start = _Here(adjusted.devices, *self._placed())
        self.size = len(self._free) + 3 * len(self.owners) + 6

    def residuals(self, change: np.ndarray) -> np.ndarray:
        """Everything that is known, each over its standard deviation."""
        here = self.here(change)
        parts = [self._whiten @ change[: len(self._free)]]
        for number in range(len(self.tied.seats)):
            parts += [self._seen_wall(number, here), self._stated_view(number, here)]
        parts += [self._stated_wall(wall, here) for wall in self.owners]
        return np.concatenate(parts)

    def here(self, change: np.ndarray) -> _Here:
        """Devices, planes and world after a change of the unknowns."""
        count = len(self._free)
        whole = np.zeros(len(self.tied.adjusted.covariance))
        whole[self._free] = change[:count]
        planes: dict[WallName, Vector] = {
            wall: self._start.planes[wall] + change[count + 3 * n : count + 3 * n + 3]
            for n, wall in enumerate(self.owners)
        }
        turn, step = change[-6:-3], change[-3:]
        world = WorldPose(
            rotation_matrix((float(turn[0]), float(turn[1]), float(turn[2]))) @ self._start.world.rotation,
            self._start.world.position_m + step,
        )
        return _Here(_moved(self._start.devices, whole), planes, world)

    def result(self, change: np.ndarray, covariance: np.ndarray) -> Together:
        """The optics of all views at a change, with their joint covariance."""
        names, numbers = self._parts()
        sizes = {number: size for _, number, size in zip(names, numbers, self._sizes(), strict=True)}
        now = self._optics(change, numbers, sizes)
        slopes = []
        for index in range(self.size):
            step = np.zeros(self.size)
            step[index] = 1e-3 * float(np.sqrt(covariance[index, index]))
            ends = [self._optics(change + sign * step, numbers, sizes) for sign in (1.0, -1.0)]
            off = [np.concatenate([difference(a, b) for a, b in zip(end, now, strict=True)]) for end in ends]
            slopes.append((off[0] - off[1]) / (2 * step[index]))
        by = np.stack(slopes, axis=1)
        whole = by @ covariance @ by.T
        rms_px = self.tied.shared_rms_px
        joint = Joint(names, rows(whole), self.tied.boards, rms_px)
        place = {number: slice(15 * n, 15 * n + 15) for n, number in enumerate(numbers)}
        optics = dict(zip(numbers, now, strict=True))
        here, views = self.here(change), {}
        for number, seat in enumerate(self.tied.seats):
            own, lamp = self.tied.cameras[number], self.tied.projectors[number]
            camera = replace(
                seat.model.camera_optics, optics=optics[own], covariance=rows(whole[place[own], place[own]])
            )
            projector = None
            if lamp is not None and seat.model.projector_optics is not None:
                projector = replace(
                    seat.model.projector_optics,
                    optics=optics[lamp],
                    covariance=rows(whole[place[lamp], place[lamp]]),
                    cross_covariance=rows(whole[place[lamp], place[own]]),
                )
            views[seat.camera] = ViewTogether(camera, projector, self._wall(number, here, covariance))
        return Together(views, joint, self.tied, self._contradictions(here))

    def _contradictions(self, here: _Here) -> tuple[str, ...]:
        """What was stated and is beyond `DOUBTED` of its standard deviations from what the pictures say."""
        mm, mrad = 1e3 * self.stated.tape_std_m, 1e3 * self.stated.square_std_rad
        found = []
        for number, seat in enumerate(self.tied.seats):
            off = np.abs(self._stated_view(number, here))
            if off[:2].size and off[:2].max() > DOUBTED:
                found.append(
                    f"{seat.camera!r} was stated {mm * off[:2].max():.0f} mm from where the others have it. Measure "
                    "it again; if a camera was moved since the boards were taken, forget those with --discard."
                )
            if off[2:].size and off[2:].max() > DOUBTED:
                turned_mrad = 1e3 * self.stated.level_std_rad * off[2:].max()
                found.append(
                    f"The board on the wall of {seat.camera!r} was {turned_mrad:.1f} mrad from level."
                )
        for wall in self.owners:
            off = np.abs(self._stated_wall(wall, here))
            if off[:2].max() > DOUBTED:
                found.append(
                    f"The wall {wall} is {mrad * off[:2].max():.1f} mrad out of square with the others."
                )
            if off[2:].size and off[2:].max() > DOUBTED:
                found.append(
                    f"The wall {wall} stands {mm * off[2:].max():.0f} mm from where the room has it."
                )
        return tuple(found)

    def _parts(self) -> tuple[tuple[str, ...], list[int]]:
        """Every device once: cameras by their names, projectors as 'projector of' the first camera they serve."""
        found: dict[int, str] = {}
        for seat, camera in zip(self.tied.seats, self.tied.cameras, strict=True):
            found[camera] = seat.camera
        for seat, lamp in zip(self.tied.seats, self.tied.projectors, strict=True):
            if lamp is not None:
                found.setdefault(lamp, f"projector of {seat.camera}")
        return tuple(found.values()), list(found)

    def _sizes(self) -> list[tuple[int, int]]:
        sizes: dict[int, tuple[int, int]] = {}
        for seat, camera in zip(self.tied.seats, self.tied.cameras, strict=True):
            sizes[camera] = seat.model.record.camera_size_px
        for seat, lamp in zip(self.tied.seats, self.tied.projectors, strict=True):
            if lamp is not None and seat.model.record.panel_size_px is not None:
                sizes.setdefault(lamp, seat.model.record.panel_size_px)
        return list(sizes.values())

    def _optics(
        self, change: np.ndarray, numbers: list[int], sizes: dict[int, tuple[int, int]]
    ) -> list[Optics]:
        here = self.here(change)
        return [optics_in(here.world, here.devices[n], sizes[n]) for n in numbers]

    def _placed(self) -> tuple[dict[WallName, Vector], WorldPose]:
        """The planes as each owner found them alone, and the room as the first view with a wall lies in it."""
        seats = self.tied.seats
        planes: dict[WallName, Vector] = {}
        for wall, number in self.owners.items():
            plane = _plane_of(seats[number].model)
            planes[wall] = plane.normal / plane.offset_m
        first = next(n for n, seat in enumerate(seats) if seat.model.plane is not None)
        world, rotation, translation = seats[first].model.world, *self._from_first(self._devices(first))
        turned = world.rotation @ rotation
        return planes, WorldPose(turned, world.position_m + world.rotation @ translation)

    def _devices(self, seat: int) -> Device:
        return self.tied.adjusted.devices[self.tied.cameras[seat]]

    @staticmethod
    def _from_first(device: Device) -> tuple[np.ndarray, np.ndarray]:
        return cv2.Rodrigues(np.asarray(device.rotation_rad, float))[0], device.translation_m

    def _is_lit(self, seat: int) -> bool:
        return self.tied.seats[seat].model.flat_wall is not None

    def _plane_in(self, wall: WallName, device: Device, here: _Here) -> Vector:
        """A wall's n / offset in the frame of a camera."""
        owner = here.devices[self.tied.cameras[self.owners[wall]]]
        (r0, t0), (r1, t1) = self._from_first(owner), self._from_first(device)
        rotation = r1 @ r0.T
        translation = t1 - rotation @ t0
        over = rotation @ here.planes[wall]
        return over / (1.0 + over @ translation)

    def _seen_wall(self, number: int, here: _Here) -> np.ndarray:
        """What a view saw of its wall: Gray code, or a board held against it."""
        model = self.tied.seats[number].model
        if model.plane is None:
            return np.zeros(0)
        camera = here.devices[self.tied.cameras[number]]
        over = self._plane_in(model.record.placement.wall, camera, here)
        lamp = self.tied.projectors[number]
        if model.flat_wall is None or lamp is None or model.record.wall is None:
            seen, whiten = self._boards[number]
            return whiten @ (over - seen)
        projector, kept = here.devices[lamp], model.flat_wall.plane.inliers
        points_m = undistorted(camera, array_of(model.record.wall.camera_px, 2)[kept])
        points_m = points_m / (points_m @ over)[:, None]
        (r0, t0), (r1, t1) = self._from_first(camera), self._from_first(projector)
        rotation = r1 @ r0.T
        predicted, _ = cv2.projectPoints(
            points_m,
            cv2.Rodrigues(rotation)[0],
            t1 - rotation @ t0,
            projector.matrix,
            projector.intrinsics[4:],
        )
        off = np.asarray(predicted, float).reshape(-1, 2) - array_of(model.record.wall.panel_px, 2)[kept]
        # As in `flat_wall`: bulges are alike over patches, so all places weigh no more than INDEPENDENT of them.
        scatter_px = model.flat_wall.rms_px / np.sqrt(2)
        return off.ravel() / (scatter_px * np.sqrt(max(len(off) / INDEPENDENT, 1.0)))

    def _framed(self, number: int, here: _Here) -> tuple[np.ndarray, np.ndarray]:
        """A camera's rotation into its view's frame (in which its wall is y_max), and its place there."""
        turn = turn_to(self.tied.seats[number].model.record.placement.wall).matrix
        rotation, translation = self._from_first(here.devices[self.tied.cameras[number]])
        into_room = here.world.rotation @ rotation.T
        place_m = here.world.position_m - into_room @ translation
        return turn @ into_room, turn @ place_m

    def _stated_view(self, number: int, here: _Here) -> np.ndarray:
        """Where a tape has the camera, or a point that it sees, across its view; and what is up in its picture."""
        model = self.tied.seats[number].model
        if model.plane is None:
            return np.zeros(0)
        record, camera = model.record, here.devices[self.tied.cameras[number]]
        rotation, place_m = self._framed(number, here)
        over = self._plane_in(record.placement.wall, camera, here)
        known = np.zeros(3)
        if record.placement.anchor_px is not None:
            ray = undistorted(camera, np.array([record.placement.anchor_px]))[0]
            known = ray / (over @ ray)
        at_m = rotation @ known + place_m
        across = (
            np.array([at_m[0] - record.placement.x_m, at_m[2] - record.placement.z_m])
            / self.stated.tape_std_m
        )
        if record.level is None and record.placement.plumb_px is None:
            return across
        offset_m = 1.0 / float(np.linalg.norm(over))
        up = rotation @ level_of(
            record, camera, replace(model.plane, normal=over * offset_m, offset_m=offset_m)
        )
        return np.append(across, np.arctan2(up[0], up[2]) / self.stated.level_std_rad)

    def _stated_wall(self, wall: WallName, here: _Here) -> np.ndarray:
        """Where the room has a wall: its direction, and its coordinate at the middle of what was seen of it."""
        number = self.owners[wall]
        model = self.tied.seats[number].model
        rotation, place_m = self._framed(number, here)
        over = here.planes[wall]
        normal = rotation @ over / np.linalg.norm(over)
        ray = _plane_of(model).centre_m
        middle_m = rotation @ (ray / (over @ ray)) + place_m
        tilt = np.array([normal[0], normal[2]]) / self.stated.square_std_rad
        stated_m = model.record.placement.wall_y_m
        if stated_m is None:
            return tilt
        return np.append(tilt, (middle_m[1] - stated_m) / self.stated.tape_std_m)

    def _wall(self, number: int, here: _Here, covariance: np.ndarray) -> CalibratedWall | None:
        """The wall of a view in the room."""
        model = self.tied.seats[number].model
        if model.plane is None or model.wall is None:
            return None
        wall = model.record.placement.wall
        owner = self.owners[wall]
        plane, over = _plane_of(self.tied.seats[owner].model), here.planes[wall]
        rotation, translation = self._from_first(here.devices[self.tied.cameras[owner]])
        into_room = here.world.rotation @ rotation.T
        place_m = here.world.position_m - into_room @ translation
        x, y, z = map(float, into_room @ (plane.centre_m / (over @ plane.centre_m)) + place_m)
        nx, ny, nz = map(float, into_room @ over / np.linalg.norm(over))
        return replace(model.wall, point_m=(x, y, z), normal=(nx, ny, nz))


def _plane_of(model: Model) -> Plane:
    if model.plane is None:  # owners have one
        raise CalibrationError("A view without a wall owns none.")
    return model.plane


def _board_on_wall(model: Model) -> tuple[Vector, np.ndarray]:
    """n / offset of a board held against the wall, in the camera's frame, and what whitens it."""
    if model.record.level is None:
        return np.zeros(3), np.zeros((0, 3))
    plane, covariance = board_plane(model.record.level, model.camera.device)
    return plane.normal / plane.offset_m, _whitening(covariance)


def _moved(devices: tuple[Device, ...], change: np.ndarray) -> tuple[Device, ...]:
    """The devices with their unknowns changed, in the order of `Adjusted.covariance`."""
    now = [replace(devices[0], intrinsics=devices[0].intrinsics + change[:9])]
    for number, device in enumerate(devices[1:]):
        own = change[9 + 15 * number : 24 + 15 * number]
        now.append(
            replace(
                device,
                intrinsics=device.intrinsics + own[:9],
                rotation_rad=device.rotation_rad + own[9:12],
                translation_m=device.translation_m + own[12:],
            )
        )
    return tuple(now)


def _whitening(covariance: np.ndarray) -> np.ndarray:
    """A matrix W with W.T @ W the inverse of the covariance; directions that nothing has fixed do not weigh."""
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    kept = values > 1e-13 * values[-1]
    return (vectors[:, kept] / np.sqrt(values[kept])).T / scale


def _inverse_of(jacobian: np.ndarray) -> np.ndarray:
    """The covariance of the unknowns whose weighted residuals have this Jacobian."""
    normal = jacobian.T @ jacobian
    scale = np.sqrt(np.diag(normal))
    scale = np.where(scale == 0, 1.0, scale)
    return np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-14) / np.outer(scale, scale)
