"""A reconstruction problem: scene, measurements, and what is known at the boundary, as arrays.

A problem does not know how it will be solved. Shifts are far below a pixel, so the flow image is linear
in the shift: per small window, `information = sum(grad I grad I^T) / variance` and
`score = sum(grad I (I_flow - I_ref)) / variance` are sufficient statistics for the data term

    1/2 (d - d_hat)^T information (d - d_hat),     d_hat = -information^-1 score,

with the displacement d in px, (column, row), of the pattern seen from I_ref to I_flow.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from core.motion import CameraMotion
from core.scene import Scene


class ShiftMeasurement(eqx.Module):
    """What one view saw, compressed to windows; columns first in every 2-vector.

    `refused` marks windows that show something else than the pattern, moved; None where all are good. `motion` is
    what the camera may have done between the exposures and is still in `displacement_px`; None where it stood still.
    The columns of `short_mean_px` are independent errors of one standard deviation: how the mean over the flow's
    bursts differs from that over a long time. None where it does not.
    """

    centres_px: Float[np.ndarray, "windows 2"]
    displacement_px: Float[np.ndarray, "windows 2"]
    information_per_px2: Float[np.ndarray, "windows 2 2"]
    window_px: int = eqx.field(static=True)
    refused: Bool[np.ndarray, " windows"] | None = None
    motion: CameraMotion | None = None
    short_mean_px: Float[np.ndarray, "windows 2 modes"] | None = None

    @property
    def common_errors_px(self) -> Float[np.ndarray, "windows 2 errors"] | None:
        """Independent errors of one standard deviation that many windows share; None where there are none."""
        errors = [] if self.motion is None else [self.motion.at(self.centres_px)]
        errors += [] if self.short_mean_px is None else [self.short_mean_px]
        return np.concatenate(errors, axis=-1) if errors else None

    def at(self, chosen: Bool[np.ndarray, " windows"]) -> "ShiftMeasurement":
        """Only the windows that are chosen."""
        return ShiftMeasurement(
            self.centres_px[chosen],
            self.displacement_px[chosen],
            self.information_per_px2[chosen],
            self.window_px,
            None if self.refused is None else self.refused[chosen],
            self.motion,
            None if self.short_mean_px is None else self.short_mean_px[chosen],
        )

    def good(self) -> "ShiftMeasurement":
        """Without the windows that were refused."""
        return self if self.refused is None else self.at(~self.refused)


class ImagePair(eqx.Module):
    """Both images of one view, and the variance of a pixel of their difference (images' unit squared).

    `sample_offsets_px`, if given, are the sensor positions (column, row) about the pixel's centre at
    which both images were rendered: they belong to a simulation and are shared with its model.
    """

    reference_image: Float[np.ndarray, "rows cols"]
    flow_image: Float[np.ndarray, "rows cols"]
    difference_variance: float
    sample_offsets_px: Float[np.ndarray, "rows cols samples 2"] | None = None


class PlaneData(eqx.Module):
    """T, p, u on a wall's plane, at vertices along the two other axes (order x, y, z)."""

    wall: str = eqx.field(static=True)
    first_m: Float[np.ndarray, " first"]
    second_m: Float[np.ndarray, " second"]
    temperature_k: Float[np.ndarray, "first second"]
    pressure_m2_s2: Float[np.ndarray, "first second"]
    velocity_m_s: Float[np.ndarray, "first second 3"]


class SensorData(eqx.Module):
    """Point sensors; NaN where a sensor does not measure a quantity."""

    position_m: Float[np.ndarray, "sensors 3"]
    temperature_k: Float[np.ndarray, " sensors"]
    temperature_std_k: Float[np.ndarray, " sensors"]
    velocity_m_s: Float[np.ndarray, "sensors 3"]
    velocity_std_m_s: Float[np.ndarray, " sensors"]


class Problem(eqx.Module):
    """Everything a solver may use. Lists are empty where a scene has no such information."""

    scene: Scene = eqx.field(static=True)
    shifts: tuple[ShiftMeasurement, ...]
    planes: tuple[PlaneData, ...] = ()
    sensors: tuple[SensorData, ...] = ()
    images: tuple[ImagePair, ...] = ()
