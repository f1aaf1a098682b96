"""The camera's motion between two exposures: read off what is still, and what stays unknown of it.

Marks that somebody drew, or a part of the picture beyond the back wall, are still if they move like a rigid picture:
the camera's motion is read off them. Where there is none, or air of the room is before them too, the motion stays in
the shifts, with the mount's stability as its prior. The solvers then marginalise it (`core.motion`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from app.reconstruct.yardstick import (
    Exposures,
    Mask,
    Rigid,
    Trusted,
    Yardstick,
    aligned,
    read_motion,
    trusted,
)
from core.drift import Similarity
from core.motion import CameraMotion
from core.problem import ShiftMeasurement

# A motion is never known better than this.
_LEAST_PX = 1e-4


@dataclass(frozen=True)
class MotionPrior:
    """What is known of the camera's motion before this pair of pictures is looked at: mean, and one deviation [px].

    `source` says where it comes from.
    """

    mean: Similarity
    std_px: float
    source: str


def mount(drift_std_px: float) -> MotionPrior:
    """By the mount's stability alone."""
    return MotionPrior(Similarity(), drift_std_px, f"the mount's stability: {drift_std_px:g} px")


@dataclass(frozen=True)
class Agreement:
    """How the camera moved between two references, and whether that explains how they differ."""

    drift: Similarity
    edge_px: Float[np.ndarray, " 4"]
    unlike: float
    agree: bool

    @property
    def said(self) -> str:
        """In words, with what to do."""
        moved = (
            f"Between the references the camera moved by {self.drift.column_px:+.3f} px across, "
            f"{self.drift.row_px:+.3f} px down, {1e6 * self.drift.rotation_rad:+.0f} urad."
        )
        if self.agree:
            return moved
        return (
            f"{moved} That does not explain how they differ: what is left is {self.unlike**0.5:.1f} times the noise. "
            "The air was not still in one of them, or something moved. Wait longer before each, and take the series "
            "again."
        )

    def at(self, share: float) -> MotionPrior:
        """The motion after a share of the time between the references: a random walk with both ends known."""
        first = Similarity(
            column_px=share * self.drift.column_px,
            row_px=share * self.drift.row_px,
            rotation_rad=share * self.drift.rotation_rad,
            dilation=share * self.drift.dilation,
        )
        step_px = float(np.sqrt(np.mean(self.edge_px**2)))
        std_px = max((share * (1 - share)) ** 0.5 * step_px, _LEAST_PX)
        return MotionPrior(first, std_px, f"two references, {step_px:.3f} px apart: {std_px:.3f} px")


def agreement(before: Exposures, in_room: Mask) -> Agreement:
    """Two references, seen through still air: every window of the wall is a yardstick."""
    read, half = read_motion(before, in_room), max(before.size_px) / 2
    total = read.motion
    edge_px = np.array([total.column_px, total.row_px, half * total.rotation_rad, half * total.dilation])
    return Agreement(total, edge_px, read.unlike, read.is_rigid)


def without_known_drift(
    exposures: Exposures,
    in_room: Mask,
    border: Mask,
    prior: MotionPrior,
    marks: Sequence[Yardstick] = (),
) -> tuple[ShiftMeasurement, Similarity, str]:
    """The shift of every window, the motion that was taken out of it, and a sentence on it.

    `in_room` are the windows on the back wall, `border` those beyond it that may be still; `marks` come first.
    """
    still = trusted(exposures, marks) if marks else Trusted((), None, ())
    said = "".join(f"{why} " for why in still.refused)
    if still.read is not None:
        if still.read.std_px < prior.std_px:
            return _known(exposures, still.read, said, f"the {_listed(still.names)}")
        said += f"The {_listed(still.names)} show too little to tell the camera's motion. "
    read = read_motion(exposures, border)
    known = read.std_px < prior.std_px
    if known and read.is_rigid:
        return _known(exposures, read, said, "the border")
    if prior.std_px == 0.0:
        shift = exposures.as_they_are.measured(follow=True)
        return shift, Similarity(), f"{said}The camera is stated to stand still between the exposures."
    shift, drift = aligned(exposures, in_room)
    moved, expected = (
        motion.displacement_px(shift.centres_px, exposures.before.shape) for motion in (drift, prior.mean)
    )
    motion = CameraMotion(exposures.size_px, prior.std_px * np.eye(4))
    shift = replace(shift, displacement_px=shift.displacement_px + moved - expected, motion=motion)
    return shift, prior.mean, said + _unknown(drift, prior, read.unlike if known else None)


def _known(
    exposures: Exposures, read: Rigid, said: str, source: str
) -> tuple[ShiftMeasurement, Similarity, str]:
    motion = CameraMotion(exposures.size_px, max(1.0, read.unlike) ** 0.5 * read.root_px)
    return replace(read.shift, motion=motion), read.motion, said + _told(read.motion, source)


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _told(drift: Similarity, source: str) -> str:
    return (
        f"Drift between the exposures, from {source}: {drift.column_px:+.4f} px across, "
        f"{drift.row_px:+.4f} px down, {1e6 * drift.rotation_rad:+.1f} urad; removed."
    )


def _unknown(drift: Similarity, prior: MotionPrior, unlike: float | None) -> str:
    why = "No part of the picture is free of the room's air."
    if unlike is not None:
        why = (
            "The border of the picture is not still: what a rigid motion leaves of it is "
            f"{unlike**0.5:.1f} times its noise, so the room's air is before it."
        )
    return (
        f"{why} The whole picture moved by {drift.column_px:+.3f} px across, {drift.row_px:+.3f} px down. How much "
        f"of that is the camera is not known exactly ({prior.source}), and is estimated together with the air."
    )
