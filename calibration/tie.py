"""Cameras and projectors of several views adjusted at once, by what more than one of them sees.

Two things tie one view's devices to another's: a board that both cameras saw at the same moment, and a projector
that lit the boards of both. Everything that each camera saw alone takes part, each picture once.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jaxtyping import Float

from calibration.adjustment import Adjusted, Device, Pose, Sighting, adjust
from calibration.errors import CalibrationError
from calibration.model import Model
from calibration.record import array_of
from calibration.shared import SharedBoard
from calibration.start import guess_pose

Motion = Float[np.ndarray, "4 4"]

# Residuals of a board that stood still are those of each camera alone; three times as large is no scatter of some
# hundred numbers (whose rms scatters by 5 %): it moved between the pictures, or is another board.
MOVED = 3.0

# A picture's own noise, and by it the fit, and by that the noise: it settles to a percent in so many rounds.
ROUNDS = 2
# What all pictures of a device show counts as so many numbers of each: the fewest with which the variance that is
# expected of a picture (a scaled inverse chi-square) has itself a variance.
POOLED = 5.0
# Only made-up pictures fit better.
_LEAST_PX = 1e-6


class NothingSharedError(CalibrationError):
    """Views that nothing ties to one another."""


@dataclass(frozen=True)
class Seat:
    """One view in a common adjustment: what its camera showed alone, and the name of the projector that lights it."""

    model: Model
    projector: str = ""

    @property
    def camera(self) -> str:
        """The camera's name."""
        return self.model.record.camera


@dataclass(frozen=True)
class Tied:
    """The common fit. Device 0 is the first seat's camera; `cameras`, `projectors` number the devices of each seat.

    `moved` names boards that do not fit and were left out; `boards` counts the shared ones that remain.
    """

    seats: tuple[Seat, ...]
    adjusted: Adjusted
    cameras: tuple[int, ...]
    projectors: tuple[int | None, ...]
    boards: int
    shared_rms_px: float
    moved: tuple[str, ...] = ()


def tie(seats: tuple[Seat, ...], shared: tuple[SharedBoard, ...]) -> Tied:
    """Adjust all devices of the seats at once.

    Raises:
        NothingSharedError: a seat that no shared board and no common projector ties to the first one.
    """
    moved: list[str] = []
    while True:
        draft = _Draft(seats, shared)
        adjusted = adjust(draft.devices(), draft.poses(), tuple(draft.sightings))
        worst = _worst(draft, adjusted)
        if worst is None:
            break
        moved.append(worst)
        shared = tuple(board for board in shared if board.name != worst)
    for _ in range(ROUNDS):
        draft.sightings = weighed(tuple(draft.sightings), adjusted)
        adjusted = adjust(adjusted.devices, adjusted.poses, tuple(draft.sightings))
    of_shared = [
        residual for number in draft.shared.values() for _, residual in _of_view(draft, adjusted, number)
    ]
    rms_px = float(np.sqrt(np.mean(np.concatenate(of_shared) ** 2) * 2)) if of_shared else 0.0
    return Tied(
        seats,
        adjusted,
        tuple(draft.number[seat.camera] for seat in seats),
        tuple(draft.projector_of(seat) for seat in seats),
        len(draft.shared),
        rms_px,
        tuple(moved),
    )


def groups(seats: tuple[Seat, ...], shared: tuple[SharedBoard, ...]) -> list[tuple[Seat, ...]]:
    """The seats by what ties them, the largest group first, each in the order of the seats."""
    left, found = list(seats), []
    while left:
        group, grown = [left.pop(0)], True
        while grown:
            near = [s for s in left if any(_links(s, other, shared) for other in group)]
            grown = bool(near)
            group += near
            left = [s for s in left if s not in near]
        found.append(tuple(s for s in seats if s in group))
    return sorted(found, key=len, reverse=True)


def _links(one: Seat, other: Seat, shared: tuple[SharedBoard, ...]) -> bool:
    lit = one.model.pair is not None and other.model.pair is not None
    if lit and one.projector and one.projector == other.projector:
        return True
    return any(one.camera in board.seen and other.camera in board.seen for board in shared)


def weighed(sightings: tuple[Sighting, ...], adjusted: Adjusted) -> list[Sighting]:
    """The sightings, each with the noise that its own residuals show.

    Corners of a tilted or far board are found three times as badly as those of one that faces the camera: one noise
    for all pictures of a device would give the bad ones too much weight.
    """
    points = dict.fromkeys(range(len(adjusted.poses)), 0)
    of_device = [0.0] * len(adjusted.devices)
    for sighting in sightings:
        points[sighting.view] += len(sighting.points_m)
        of_device[sighting.device] += len(sighting.points_m)
    # What a board's pose and a device's unknowns take of the freedom, by how many points tell them.
    free = [float(np.sum(device.free)) + (6.0 if n else 0.0) for n, device in enumerate(adjusted.devices)]
    squares, freedom = [], []
    for sighting, residual in zip(sightings, adjusted.residuals_px, strict=True):
        count = len(sighting.points_m)
        taken = 6.0 / points[sighting.view] + free[sighting.device] / of_device[sighting.device]
        squares.append(float(np.sum(residual**2)))
        freedom.append(max(count * (2.0 - taken), 0.0))
    found = []
    for sighting, square, own in zip(sightings, squares, freedom, strict=True):
        mates = [n for n, other in enumerate(sightings) if other.device == sighting.device]
        mean = sum(squares[n] for n in mates) / max(sum(freedom[n] for n in mates), 1.0)
        sigma_px = np.sqrt((square + POOLED * mean) / (own + POOLED))
        noise_nd = max(float(sigma_px), _LEAST_PX) / adjusted.devices[sighting.device].sigma_px
        found.append(replace(sighting, noise_nd=noise_nd))
    return found


@dataclass
class _Draft:
    """The start: every device and every board in the frame of the first camera, and who saw what."""

    seats: tuple[Seat, ...]
    boards: tuple[SharedBoard, ...]
    number: dict[str, int] = field(default_factory=dict)
    from_first: list[Motion] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)
    shared: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._alone: list[Device] = []
        self._places: list[Motion] = []
        cameras = self._cameras_from_first()
        for seat, motion in zip(self.seats, cameras, strict=True):
            fit = seat.model.camera
            self._add(seat.camera, replace(fit.device, sigma_px=fit.rms_px), motion)
        for seat, motion in zip(self.seats, cameras, strict=True):
            pair, name = seat.model.pair, _lamp(seat)
            if pair is not None and name not in self.number:
                device = replace(pair.adjusted.devices[1], sigma_px=pair.projector.rms_px)
                self._add(name, device, _motion_of(device) @ motion)
        self._see()

    def devices(self) -> tuple[Device, ...]:
        """All devices, at where they start."""
        placed = []
        for device, motion in zip(self._alone, self.from_first, strict=True):
            placed.append(
                replace(
                    device, rotation_rad=cv2.Rodrigues(motion[:3, :3])[0].ravel(), translation_m=motion[:3, 3]
                )
            )
        return tuple(placed)

    def poses(self) -> tuple[Pose, ...]:
        """All boards, at where they start."""
        return tuple(Pose(cv2.Rodrigues(m[:3, :3])[0].ravel(), m[:3, 3]) for m in self._places)

    def projector_of(self, seat: Seat) -> int | None:
        """The number of the seat's projector, if one was calibrated."""
        return None if seat.model.pair is None else self.number[_lamp(seat)]

    def _add(self, name: str, device: Device, motion: Motion) -> None:
        self.number[name] = len(self._alone)
        self._alone.append(device)
        self.from_first.append(motion)

    def _see(self) -> None:
        """Every sighting once: a shared picture that a camera was calibrated with is that camera's own board."""
        for board in self.boards:
            self.shared[board.name] = len(self._places)
            name, seen = next(iter(board.seen.items()))
            start = guess_pose(
                array_of(seen.points_m, 3), array_of(seen.camera_px, 2), self._intrinsics(name)
            )
            self._places.append(np.linalg.inv(self.from_first[self.number[name]]) @ _motion_of(start))
        for seat in self.seats:
            own = self._own_boards(seat)
            for board in self.boards:
                seen = board.seen.get(seat.camera)
                if seen is not None and self.shared[board.name] not in own.values():
                    device, view = self.number[seat.camera], self.shared[board.name]
                    points = array_of(seen.points_m, 3), array_of(seen.camera_px, 2)
                    self.sightings.append(Sighting(device, view, *points))

    def _own_boards(self, seat: Seat) -> dict[int, int]:
        """The numbers of a camera's own boards, with what it and its projector saw of them."""
        model, device = seat.model, self.number[seat.camera]
        by_picture = {
            board.seen[seat.camera].sha256: self.shared[board.name]
            for board in self.boards
            if seat.camera in board.seen
        }
        numbers = {}
        for view, (board, pose) in enumerate(
            zip(model.record.boards, model.camera.adjusted.poses, strict=True)
        ):
            if board.sha256 in by_picture:
                numbers[view] = by_picture[board.sha256]
                continue
            numbers[view] = len(self._places)
            self._places.append(np.linalg.inv(self.from_first[device]) @ _motion_of(pose))
        for sighting in model.camera.sightings:
            self.sightings.append(replace(sighting, device=device, view=numbers[sighting.view]))
        for sighting in () if model.pair is None else model.pair.sightings:
            if sighting.device == 1:
                self.sightings.append(
                    replace(sighting, device=self.number[_lamp(seat)], view=numbers[sighting.view])
                )
        return numbers

    def _intrinsics(self, camera: str) -> np.ndarray:
        return self._alone[self.number[camera]].intrinsics

    def _cameras_from_first(self) -> list[Motion]:
        """Each camera's frame from the first one's, along whatever ties them."""
        known: dict[str, Motion] = {self.seats[0].camera: np.eye(4)}
        grown = True
        while grown:
            grown = False
            for one in self.seats:
                for other in self.seats:
                    if one.camera in known and other.camera not in known:
                        step = self._step(one, other)
                        if step is not None:
                            known[other.camera], grown = step @ known[one.camera], True
        untied = [repr(seat.camera) for seat in self.seats if seat.camera not in known]
        if untied:
            raise NothingSharedError(
                f"Nothing that both see ties {', '.join(untied)} to {self.seats[0].camera!r}. Take pictures of one "
                "board by both cameras at the same time, where both see it whole, at three places or more."
            )
        return [known[seat.camera] for seat in self.seats]

    def _step(self, one: Seat, other: Seat) -> Motion | None:
        """The other camera's frame from one's: of all that ties them, what fits their boards best."""
        both = [b.seen for b in self.boards if one.camera in b.seen and other.camera in b.seen]
        poses = [(_pose(one, seen), _pose(other, seen)) for seen in both]
        tries = [b @ np.linalg.inv(a) for a, b in poses]
        lit = one.model.pair, other.model.pair
        if one.projector and one.projector == other.projector and lit[0] is not None and lit[1] is not None:
            lamps = [_motion_of(pair.adjusted.devices[1]) for pair in lit if pair is not None]
            tries.append(np.linalg.inv(lamps[1]) @ lamps[0])

        def misfit(motion: Motion) -> float:
            return float(np.median([np.linalg.norm(motion @ a - b) for a, b in poses])) if poses else 0.0

        return min(tries, key=misfit, default=None)


def _lamp(seat: Seat) -> str:
    """A name that no camera has: the seat's projector, shared with others of that name."""
    return f"projector\n{seat.projector or seat.camera}"


def _pose(seat: Seat, seen: dict) -> Motion:
    board = seen[seat.camera]
    points, pixels = array_of(board.points_m, 3), array_of(board.camera_px, 2)
    return _motion_of(guess_pose(points, pixels, seat.model.camera.device.intrinsics))


def _motion_of(placed: Pose | Device) -> Motion:
    motion = np.eye(4)
    motion[:3, :3] = cv2.Rodrigues(np.asarray(placed.rotation_rad, float))[0]
    motion[:3, 3] = placed.translation_m
    return motion


def _of_view(draft: _Draft, adjusted: Adjusted, view: int) -> Iterator[tuple[Sighting, np.ndarray]]:
    """All that was seen of one board, with its residuals [px]."""
    for sighting, residual in zip(draft.sightings, adjusted.residuals_px, strict=True):
        if sighting.view == view:
            yield sighting, residual


def _worst(draft: _Draft, adjusted: Adjusted) -> str | None:
    """The shared board that fits least, where it does not fit at all."""

    def rms_of(view: int) -> float:
        # sigma_px is of a point's distance, which is the root of two coordinates' variance.
        weighted = [
            np.sqrt(2.0) * residual / adjusted.devices[sighting.device].sigma_px
            for sighting, residual in _of_view(draft, adjusted, view)
        ]
        return float(np.sqrt(np.mean(np.concatenate(weighted) ** 2)))

    rms = {name: rms_of(view) for name, view in draft.shared.items()}
    worst = max(rms, key=lambda name: rms[name], default=None)
    return None if worst is None or rms[worst] <= MOVED else worst
