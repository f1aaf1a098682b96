"""Aperture cone, data term, window and precision, by the leading term of each one's error."""

import numpy as np

from core.plan.choice import SAFETY, SHARE, Choice
from core.plan.signal import Signal
from core.scene import Scene

# Relative error of a float32 shift (core/README.md, Rays and images), doubled.
_FLOAT32 = 2e-6


def aperture(scene: Scene, view: int, signal: Signal) -> Choice:
    """The lens averages the shift over a disc of diameter d: an error of d^2 / 32 times its curvature."""
    eye, given = scene.views[view], scene.rays.aperture_cone
    limit = SHARE * signal.noise.mean_px
    if eye.f_number is None or eye.focal_m is None:
        return Choice(
            "aperture cone", False, 0.0, limit, "px", 1 / 7, "no f_number and focal_m are given: a pinhole"
        )
    to_wall_m = scene.room.upper_m[1] - eye.camera.position_m[1]
    disc_m = eye.focal_m / eye.f_number * scene.room.size_m[1] / to_wall_m
    disc_px = disc_m * max(eye.camera.focal_px) / to_wall_m
    bound = SAFETY * disc_px**2 / 32 * _curvature_per_px2(signal)
    value = bound > limit if given == "auto" else given
    reason = f"the lens sees the front of the room through a disc of {1e3 * disc_m:.1f} mm"
    return Choice(
        "aperture cone", value, 0.0 if value else bound, limit, "px", 1.0 if value else 1 / 7, reason
    )


def data_term(scene: Scene, view: int, signal: Signal) -> Choice:
    """The images are linear in the shift to (2 pi d / period)^2 / 6 of it."""
    largest = signal.shift.percentile_px(100)
    period_px = 2 * np.pi * signal.noise.brightness * signal.noise.contrast / signal.noise.gradient_per_px
    bound = largest * (2 * np.pi * largest / period_px) ** 2 / 6
    limit = SHARE * signal.noise.mean_px
    given = scene.solve.data_term
    value = ("displacement" if bound <= limit else "warped") if given == "auto" else given
    return Choice(
        "data term", value, bound if value == "displacement" else 0.0, limit, "px",
        len(signal.shift.centres_px) * signal.shift.stride**2 / scene.views[view].camera.width_px
        / scene.views[view].camera.height_px if value == "displacement" else 1.0,
        f"shifts of at most {largest:.2g} px on a pattern of {period_px:.0f} px a period",
    )  # fmt: skip


def window(signal: Signal) -> Choice:
    """A window averages the shift: an error of w^2 / 24 times its curvature."""
    window_px = signal.noise.window_px
    bound = window_px**2 / 24 * _curvature_per_px2(signal)
    return Choice(
        "window", window_px, bound, signal.noise.mean_px, "px", 1 / window_px**2,
        "the operator averages over the same window, so that the bound is what a wrong shape would cost",
    )  # fmt: skip


def precision(signal: Signal) -> Choice:
    """Float32 throughout but for geometry, which is prepared in float64."""
    bound = _FLOAT32 * signal.shift.percentile_px(100)
    return Choice(
        "precision", "float32", bound, SHARE * signal.noise.mean_px, "px", 0.5,
        "deviations from straight rays and excess refractivity are carried, never absolute values",
    )  # fmt: skip


def _curvature_per_px2(signal: Signal) -> float:
    """99th percentile of the shift's second differences."""
    columns, rows = (np.unique(signal.shift.centres_px[:, i]) for i in (0, 1))
    picture = np.full((len(rows), len(columns), 2), np.nan)
    at = (
        np.searchsorted(rows, signal.shift.centres_px[:, 1]),
        np.searchsorted(columns, signal.shift.centres_px[:, 0]),
    )
    picture[at] = signal.shift.displacement_px
    found = [np.abs(np.diff(picture, 2, axis=a)).ravel() for a in (0, 1) if picture.shape[a] > 2]
    step_px = signal.noise.window_px * signal.shift.stride
    values = np.concatenate(found) if found else np.zeros(1)
    return float(np.nanpercentile(values, 99)) / step_px**2 if np.isfinite(values).any() else 0.0
