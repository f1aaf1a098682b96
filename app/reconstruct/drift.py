"""The camera's motion between two exposures: read off what is still, and what stays unknown of it.

Marks that somebody drew, or a part of the picture beyond the back wall, are still if they move like a rigid picture:
the camera's motion is read off them. There may be as much air before a border as the noise hides, and that counts in
how well it tells the motion. Where nothing is still, the motion stays in the shifts, with the mount's stability as
its prior. The solvers marginalise what is unknown of it (`core.motion`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from app.reconstruct.yardstick import (
    Exposures,
    Mask,
    MotionPrior,
    Rigid,
    Trusted,
    Yardstick,
    aligned,
    believed,
    read_border,
    read_motion,
    trusted,
)
from core.drift import STILL, Motion
from core.geometry import Optics
from core.motion import MOTIONS, CameraMotion, motion_basis
from core.problem import ShiftMeasurement

# A motion is never known better than this.
_LEAST_PX = 1e-4
# A border is of use if it leaves the motion less uncertain than this share of the mount's deviation. Of a mount that
# is stable to 1 px this is what air moves the picture by: hundredths of a pixel.
_TELLS = 0.05
# Two references tell a motion of any size.
_UNBOUND_PX = 100.0


def mount(drift_std_px: float) -> MotionPrior:
    """By the mount's stability alone."""
    return MotionPrior(STILL, drift_std_px, f"the mount's stability: {drift_std_px:g} px")


@dataclass(frozen=True)
class Agreement:
    """How the camera moved between two references, and whether that explains how they differ.

    `middle_px` is how far the middle of the picture moved, and `typical_px` how far its windows did (rms).
    """

    drift_px: Motion
    middle_px: Float[np.ndarray, " 2"]
    typical_px: float
    what_is_left: str
    agree: bool

    @property
    def said(self) -> str:
        """In words, with what to do."""
        moved = f"Between the references the camera moved: {_moved(self.middle_px, self.drift_px)}."
        if self.agree:
            return moved
        return (
            f"{moved} That does not explain how they differ: {self.what_is_left}. "
            "The air was not still in one of them, or something moved. Wait longer before each, and take the series "
            "again."
        )

    def at(self, share: float) -> MotionPrior:
        """The motion after a share of the time between the references: a random walk with both ends known."""
        std_px = max((share * (1 - share)) ** 0.5 * self.typical_px, _LEAST_PX)
        source = f"two references, {self.typical_px:.3f} px apart: {std_px:.3f} px"
        return MotionPrior(share * self.drift_px, std_px, source)


def agreement(before: Exposures, in_room: Mask) -> Agreement:
    """Two references, seen through still air: every window of the wall is a yardstick."""
    read = read_motion(before, in_room, mount(_UNBOUND_PX))
    if read is None:
        return Agreement(STILL, np.zeros(2), 0.0, "", True)
    basis = motion_basis(read.shift.centres_px[in_room], before.optics)
    typical_px = float(np.sqrt(np.mean(np.sum((basis @ read.motion_px) ** 2, axis=1))))
    return Agreement(
        read.motion_px,
        _of_middle(read.motion_px, before.optics),
        typical_px,
        read.what_is_left,
        read.is_rigid,
    )


def without_known_drift(
    exposures: Exposures,
    in_room: Mask,
    border: Mask,
    prior: MotionPrior,
    marks: Sequence[Yardstick] = (),
) -> tuple[ShiftMeasurement, Motion, str]:
    """The shift of every window, the motion that was taken out of it, and a sentence on it.

    `in_room` are the windows on the back wall, `border` those beyond it that may be still; `marks` come first.
    """
    if prior.std_px == 0.0:
        shift = exposures.as_they_are.measured(follow=True)
        return shift, STILL, "The camera is stated to stand still between the exposures."
    still = trusted(exposures, marks, prior) if marks else Trusted((), None, ())
    said = "".join(f"{why} " for why in still.refused)
    if still.read is not None:
        return _known(exposures, still.read, said, f"the {_listed(still.names)}")
    read = read_border(exposures, border, prior)
    told = believed(read, prior, exposures.optics) if read is not None and read.is_rigid else None
    if told is not None and _unknown_px(told, exposures) < _TELLS * prior.std_px:
        if told.odd:
            said += (
                f"{100 * told.odd:.2g} % of the border moves unlike the rest (something moved there, or the room's "
                "air is before it) and does not count. "
            )
        return _known(exposures, told, said, "the border")
    shift, drift_px = aligned(exposures, in_room, prior)
    back_px = motion_basis(shift.centres_px, exposures.optics) @ (drift_px - prior.mean_px)
    motion = CameraMotion(exposures.optics, prior.std_px * np.eye(MOTIONS))
    shift = replace(shift, displacement_px=shift.displacement_px + back_px, motion=motion)
    return shift, prior.mean_px, said + _unknown(_of_middle(drift_px, exposures.optics), prior, read)


def _known(exposures: Exposures, read: Rigid, said: str, source: str) -> tuple[ShiftMeasurement, Motion, str]:
    told = _moved(_of_middle(read.motion_px, exposures.optics), read.motion_px)
    return (
        replace(read.shift, motion=CameraMotion(exposures.optics, read.root_px)),
        read.motion_px,
        f"{said}Drift between the exposures, from {source}: {told}; removed, and known to "
        f"{_unknown_px(read, exposures):.2g} px.",
    )


def _unknown_px(read: Rigid, exposures: Exposures) -> float:
    """How far what stays unknown of a motion moves the picture's windows (rms)."""
    motions = CameraMotion(exposures.optics, read.root_px).at(read.shift.centres_px)
    return float(np.sqrt(np.mean(np.sum(motions**2, axis=(1, 2)))))


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _of_middle(motion_px: Motion, optics: Optics) -> Float[np.ndarray, " 2"]:
    """How far a motion of the camera moves the middle of its picture."""
    middle = (np.array([[optics.width_px, optics.height_px]]) - 1.0) / 2.0
    return motion_basis(middle, optics)[0] @ motion_px


def _moved(middle_px: Float[np.ndarray, " 2"], motion_px: Motion) -> str:
    across, down = middle_px
    _, _, magnified, rolled, _, _ = motion_px
    return (
        f"{across:+.4f} px across and {down:+.4f} px down in the middle of the picture, rolled by {rolled:+.4f} px "
        f"and magnified by {magnified:+.4f} px at its edge"
    )


def _unknown(middle_px: Float[np.ndarray, " 2"], prior: MotionPrior, border: Rigid | None) -> str:
    why = "No part of the picture is free of the room's air."
    if border is not None and border.is_rigid:
        shown = int(border.asked.sum())
        why = (
            f"The {shown} windows beyond the wall that show something tell too little of the camera's motion."
        )
    elif border is not None:
        why = (
            f"The border of the picture is not still: {border.what_is_left}, so the room's air is before it, or "
            "something moved there."
        )
    return (
        f"{why} The middle of the picture moved by {middle_px[0]:+.3f} px across, {middle_px[1]:+.3f} px down. How "
        f"much of that is the camera is not known exactly ({prior.source}), and is estimated together with the air."
    )
