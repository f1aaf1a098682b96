"""The camera's motion between two exposures: read off what is still, and what stays unknown of it.

A part of the picture beyond the back wall is still if it moves like a rigid picture: the camera's motion is read off
it. Where there is none, or air of the room is before it too, the motion stays in the shifts, with the mount's
stability as its prior. The solvers then marginalise it (`core.motion`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Float32

from core.displacement import measure_shift
from core.drift import Similarity, fit_similarity, move_image
from core.motion import CameraMotion
from core.problem import ShiftMeasurement

Mask = Bool[np.ndarray, " windows"]

# A drift below this moves no window by more than the noise of a hundred frames.
_SMALL_DRIFT_PX = 2e-3
_PASSES = 3
# What a rigid motion leaves of a still border has a mean square of 1 over its noise, which the noise model may have
# wrong by this factor; chance adds at most so many standard deviations (one still border in 30,000 is refused).
_NOISE_FACTOR, _SIGMAS = 1.3, 4.0
# A motion is never known better than this.
_LEAST_PX = 1e-4
# Fewer windows than this say nothing of a rigid motion.
_LEAST_WINDOWS = 12


@dataclass(frozen=True)
class Exposures:
    """The two pictures of a view, the variance of their difference, and the windows' width."""

    before: Float32[np.ndarray, "rows cols"]
    after: Float32[np.ndarray, "rows cols"]
    variance: Float32[np.ndarray, "rows cols"]
    window_px: int

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.before.shape[1], self.before.shape[0]


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
    shift, drift = _aligned(before, in_room)
    good = _good(shift, in_room)
    rest, _ = fit_similarity(shift, good, before.before.shape)
    left_px = shift.displacement_px - rest.displacement_px(shift.centres_px, before.before.shape)
    unlike, total = _mean_square(shift, left_px, good), rest.after(drift)
    half = max(before.size_px) / 2
    edge_px = np.array([total.column_px, total.row_px, half * total.rotation_rad, half * total.dilation])
    return Agreement(total, edge_px, unlike, _is_noise(unlike, int(good.sum())))


def without_known_drift(
    exposures: Exposures, in_room: Mask, beyond: Mask, prior: MotionPrior
) -> tuple[ShiftMeasurement, Similarity, str]:
    """The shift of every window, the motion that was taken out of it, and a sentence on it.

    `in_room` are the windows on the back wall, `beyond` those that may be still.
    """
    shift, drift = _aligned(exposures, beyond)
    rest, covariance = fit_similarity(shift, _good(shift, beyond), exposures.before.shape)
    shape = exposures.before.shape
    left_px = shift.displacement_px - rest.displacement_px(shift.centres_px, shape)
    unlike = _mean_square(shift, left_px, _good(shift, beyond))
    rigid = _is_noise(unlike, int(beyond.sum()))
    root_px = _root_px(covariance, exposures.size_px)
    known = float(np.linalg.norm(root_px, axis=0).max()) < prior.std_px
    if known and rigid:
        still = rest.displacement_px(shift.centres_px, exposures.before.shape)
        motion = CameraMotion(exposures.size_px, max(1.0, unlike) ** 0.5 * root_px)
        shift = replace(shift, displacement_px=shift.displacement_px - still, motion=motion)
        return shift, rest.after(drift), _told(rest.after(drift))
    if prior.std_px == 0.0:
        shift = measure_shift(exposures.before, exposures.after, exposures.variance, exposures.window_px)
        return shift, Similarity(), "The camera is stated to stand still between the exposures."
    shift, drift = _aligned(exposures, in_room)
    moved, expected = (
        motion.displacement_px(shift.centres_px, exposures.before.shape) for motion in (drift, prior.mean)
    )
    motion = CameraMotion(exposures.size_px, prior.std_px * np.eye(4))
    shift = replace(shift, displacement_px=shift.displacement_px + moved - expected, motion=motion)
    return shift, prior.mean, _unknown(drift, prior, unlike if known else None)


def _is_noise(mean_square: float, windows: int) -> bool:
    """Whether what a motion leaves of so many windows is their noise."""
    return mean_square <= _NOISE_FACTOR * (1.0 + _SIGMAS / max(windows, 1) ** 0.5)


def _aligned(exposures: Exposures, yardstick: Mask) -> tuple[ShiftMeasurement, Similarity]:
    """The shifts that are left when the reference is moved as the yardstick moved, and that motion."""
    moved, drift, shape = exposures.before, Similarity(), exposures.before.shape
    for _ in range(_PASSES if yardstick.sum() >= _LEAST_WINDOWS else 0):
        shift = measure_shift(moved, exposures.after, exposures.variance, exposures.window_px, follow=False)
        rest, _ = fit_similarity(shift, _good(shift, yardstick), shape)
        if max(abs(rest.column_px), abs(rest.row_px)) < _SMALL_DRIFT_PX:
            break
        drift = rest.after(drift)
        moved = move_image(exposures.before, drift)
    return measure_shift(moved, exposures.after, exposures.variance, exposures.window_px), drift


def _good(shift: ShiftMeasurement, chosen: Mask) -> Mask:
    return chosen if shift.refused is None else chosen & ~shift.refused


def _mean_square(shift: ShiftMeasurement, left_px: Float[np.ndarray, "windows 2"], chosen: Mask) -> float:
    """Mean square over the noise of what a fitted motion leaves of some windows."""
    squares = np.einsum("wa,wab,wb->w", left_px, shift.information_per_px2, left_px)[chosen]
    return float(squares.sum() / max(2 * chosen.sum() - 4, 1))


def _root_px(covariance: Float[np.ndarray, "4 4"], size_px: tuple[int, int]) -> Float[np.ndarray, "4 4"]:
    """Motions of one standard deviation, in px at the picture's edge; without bound where nothing is known."""
    to_edge = np.array([1.0, 1.0, max(size_px) / 2, max(size_px) / 2])
    values, vectors = np.linalg.eigh(covariance * np.outer(to_edge, to_edge))
    if values[0] <= 1e-12 * values[-1]:
        return np.full((4, 4), np.inf)
    return vectors * np.sqrt(values)


def _told(drift: Similarity) -> str:
    return (
        f"Drift between the exposures, from the border: {drift.column_px:+.4f} px across, "
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
