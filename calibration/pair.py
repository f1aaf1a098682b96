"""Camera and projector together: one adjustment over all boards that either has seen.

Each device is first fitted alone, which gives its distortion order, its start and the weight of its
residuals; then both, with the boards' poses shared. Camera views without Gray code take part too.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.adjustment import Adjusted, Pose, Sighting, adjust
from calibration.intrinsics import Intrinsics, fit_intrinsics


@dataclass(frozen=True)
class Pair:
    """Camera (device 0, at the origin of its own frame) and projector (device 1), adjusted together.

    `camera` and `projector` are the fits of each alone; `adjusted` is the common one, whose sightings
    are `sightings`.
    """

    camera: Intrinsics
    projector: Intrinsics
    adjusted: Adjusted
    sightings: tuple[Sighting, ...]

    @property
    def rms_px(self) -> float:
        """Root mean squared distance over both devices' points in the common fit."""
        return self.adjusted.rms_px(self.sightings)


def fit_pair(
    camera: Intrinsics, projector_sightings: tuple[Sighting, ...], panel_px: tuple[int, int]
) -> Pair:
    """Fit the projector alone, then both; `projector_sightings` carry the camera's view numbers."""
    views = [s.view for s in projector_sightings]
    alone = fit_intrinsics(
        tuple(replace(s, device=0, view=i) for i, s in enumerate(projector_sightings)),
        panel_px,
        offset_lens=True,
    )
    sightings = camera.sightings + tuple(
        replace(s, device=1, view=v) for s, v in zip(alone.sightings, views, strict=True)
    )
    poses = camera.adjusted.poses
    rotation, translation = between([poses[v] for v in views], alone.adjusted.poses)
    devices = (
        replace(camera.device, sigma_px=camera.rms_px),
        replace(alone.device, rotation_rad=rotation, translation_m=translation, sigma_px=alone.rms_px),
    )
    return Pair(camera, alone, adjust(devices, poses, sightings), sightings)


def between(in_camera: list[Pose], in_projector: tuple[Pose, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vector and translation [m] of the projector from camera, averaged over the boards that both place."""
    rotations, translations = [], []
    for a, b in zip(in_camera, in_projector, strict=True):
        rotation = Rotation.from_rotvec(b.rotation_rad) * Rotation.from_rotvec(a.rotation_rad).inv()
        rotations.append(rotation.as_quat())
        translations.append(b.translation_m - rotation.apply(a.translation_m))
    mean = Rotation.from_quat(np.stack(rotations)).mean()
    return mean.as_rotvec(), np.median(np.stack(translations), axis=0)
