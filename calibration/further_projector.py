"""A projector before a camera that is calibrated already: the camera stands as it is, the projector alone is fitted.

    boards under the projector's Gray code -> the projector from the camera -> the projector in the room

The camera's parts come with their covariance. The projector takes over what they are wrong by: to first order it
follows the camera's intrinsics as the fit does, and the camera's pose as a rigid body.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from calibration.adjustment import Adjusted, Device, Sighting, adjust, carried
from calibration.advice import advise
from calibration.bundle import CalibratedOptics
from calibration.errors import TooFewViewsError
from calibration.intrinsics import Intrinsics, fit_intrinsics
from calibration.model import MINIMUM_VIEWS, quality_of, rows
from calibration.pair import between
from calibration.record import Record, array_of
from calibration.start import guess_pose_and_error
from calibration.world import WorldPose, difference, optics_in, shifted
from core.geometry import Optics


@dataclass(frozen=True)
class FurtherProjector:
    """What follows from a record of boards under a projector, whose camera was calibrated before.

    `projector` is the fit of the projector alone, `adjusted` that of it (device 1) before the camera (device 0),
    whose sightings are `sightings`. `optics` is the projector in the room; its cross covariance is with that camera.
    """

    record: Record
    projector: Intrinsics
    adjusted: Adjusted
    sightings: tuple[Sighting, ...]
    optics: CalibratedOptics

    @property
    def rms_px(self) -> float:
        """Root mean squared distance over both devices' points."""
        return self.adjusted.rms_px(self.sightings)


def build_projector(record: Record, camera: CalibratedOptics) -> FurtherProjector:
    """The projector of a record by a camera that is known.

    Raises:
        CalibrationError: fewer than three boards that both see.
    """
    lit = [board for board in record.boards if board.panel_px]
    if len(lit) < MINIMUM_VIEWS or record.panel_size_px is None:
        raise TooFewViewsError(
            f"{len(lit)} boards carry usable Gray code; expected at least {MINIMUM_VIEWS}, better 6. Take more "
            "sequences, each with the board elsewhere and tilted; those found so far are kept."
        )
    seen = [(array_of(board.points_m, 3), array_of(board.camera_px, 2)) for board in lit]
    shown = tuple(
        Sighting(0, n, array_of(board.panel_points_m, 3), array_of(board.panel_px, 2))
        for n, board in enumerate(lit)
    )
    alone = fit_intrinsics(shown, record.panel_size_px, offset_lens=True)
    intrinsics = _intrinsics(camera.optics)
    guesses = [guess_pose_and_error(points, pixels, intrinsics) for points, pixels in seen]
    rms_px = float(np.sqrt(sum(error for _, error in guesses) / sum(len(pixels) for _, pixels in seen)))
    poses = tuple(pose for pose, _ in guesses)
    rotation, translation = between(list(poses), alone.adjusted.poses)
    devices = (
        Device(intrinsics, np.zeros(9, bool), np.zeros(3), np.zeros(3), rms_px),
        replace(alone.device, rotation_rad=rotation, translation_m=translation, sigma_px=alone.rms_px),
    )
    sightings = tuple(Sighting(0, n, *both) for n, both in enumerate(seen))
    sightings += tuple(replace(one, device=1) for one in alone.sightings)
    adjusted = adjust(devices, poses, sightings)
    size_px = record.panel_size_px
    optics, covariance, cross = _in_room(adjusted, carried(adjusted, sightings), camera, size_px)
    quality = quality_of(alone, advise(alone, tuple(board.name for board in lit), size_px), size_px)
    found = CalibratedOptics("projector", optics, rows(covariance), rows(cross), quality)
    return FurtherProjector(record, alone, adjusted, sightings, found)


def _in_room(
    adjusted: Adjusted,
    by_camera: Float[np.ndarray, "24 9"],
    camera: CalibratedOptics,
    size_px: tuple[int, int],
) -> tuple[Optics, Float[np.ndarray, "15 15"], Float[np.ndarray, "15 15"]]:
    """The projector in the room, its covariance, and that with the camera (columns)."""
    known, own = camera.covariance_matrix(), adjusted.covariance[9:, 9:]

    def placed(of_camera: np.ndarray, of_projector: np.ndarray) -> Optics:
        seeing = shifted(camera.optics, of_camera)
        device, change = adjusted.devices[1], of_projector + by_camera[9:] @ of_camera[:9]
        moved = replace(
            device,
            intrinsics=device.intrinsics + change[:9],
            rotation_rad=device.rotation_rad + change[9:12],
            translation_m=device.translation_m + change[12:],
        )
        return optics_in(WorldPose(seeing.rotation.T, np.array(seeing.position_m)), moved, size_px)

    now = placed(np.zeros(15), np.zeros(15))
    stds = np.sqrt(np.concatenate([np.diag(known), np.diag(own)]))
    slopes = np.zeros((15, 30))
    for index in np.flatnonzero(stds > 0):
        step = np.zeros(30)
        step[index] = 1e-3 * stds[index]
        ends = [difference(placed(*np.split(sign * step, 2)), now) for sign in (1.0, -1.0)]
        slopes[:, index] = (ends[0] - ends[1]) / (2 * step[index])
    of_camera, of_projector = slopes[:, :15], slopes[:, 15:]
    covariance = of_camera @ known @ of_camera.T + of_projector @ own @ of_projector.T
    return now, covariance, of_camera @ known


def _intrinsics(optics: Optics) -> Float[np.ndarray, "9"]:
    return np.array([*optics.focal_px, *optics.principal_px, *optics.distortion])
