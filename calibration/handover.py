"""What the calibration hands to the scene: one ray a pixel, the wall-to-panel map, the age of it all.

The differentiable maps themselves are `core.rays.optics.Pinhole`: `direction` (pixel to ray, by Newton's
method on the distortion) and `project` (wall point to panel pixel), made from the bundle's `Optics`. They
are derived once a scene, in float64, and no measured image is ever resampled.
"""

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from calibration.bundle import Bundle
from calibration.errors import BundleError
from core.rays.optics import pinhole

# Lamps and lenses settle within half an hour; a camera's centre moves by some 0.1 px per kelvin.
OLD_DAYS = 7.0
WARM_K = 3.0
WARM_UP_MINUTES = 20.0


@dataclass(frozen=True)
class PixelRays:
    """One ray for each pixel of a camera: the common origin and unit directions in the world."""

    origin_m: Float[np.ndarray, "3"]
    directions: Float[np.ndarray, "rows cols 3"]


def pixel_rays(bundle: Bundle, camera: str | None = None) -> PixelRays:
    """The rays of a camera's pixel centres, float64. Raises BundleError if there is no such camera."""
    optics = bundle.camera(camera).optics
    y, x = np.mgrid[: optics.height_px, : optics.width_px]
    pixels = np.stack([x, y], axis=-1).reshape(-1, 2).astype(float)
    with jax.enable_x64(True):
        directions = np.asarray(jax.jit(jax.vmap(pinhole(optics).direction))(jnp.asarray(pixels)))
    return PixelRays(np.array(optics.position_m), directions.reshape(*x.shape, 3))


def wall_to_panel(bundle: Bundle) -> Callable[[Float[Array, "3"]], Float[Array, "2"]]:
    """The differentiable map wall point [m] -> panel pixel. Raises BundleError without a projector."""
    if bundle.projector is None:
        raise BundleError("The calibration has no projector; run 'airlens calibrate projector'.")
    return pinhole(bundle.projector.optics).project


def warnings_for(
    bundle: Bundle,
    captured: str,
    ambient_temperature_k: float | None = None,
    minutes_on: float | None = None,
) -> tuple[str, ...]:
    """Why a capture of that moment (ISO 8601) and those conditions may not fit this calibration."""
    made, taken = (dt.datetime.fromisoformat(text) for text in (bundle.date, captured))
    days = (taken - made).total_seconds() / 86400
    found = []
    if abs(days) > OLD_DAYS:
        found.append(
            f"The calibration is {abs(days):.0f} days {'older' if days > 0 else 'newer'} than the capture."
        )
    if ambient_temperature_k is not None and bundle.ambient_temperature_k is not None:
        change_k = ambient_temperature_k - bundle.ambient_temperature_k
        if abs(change_k) > WARM_K:
            found.append(f"The room is {change_k:+.1f} K against the calibration.")
    if minutes_on is not None and bundle.minutes_on is not None:
        if min(minutes_on, bundle.minutes_on) < WARM_UP_MINUTES < max(minutes_on, bundle.minutes_on):
            found.append(
                f"The devices had been on for {bundle.minutes_on:.0f} minutes at the calibration and for "
                f"{minutes_on:.0f} at the capture; they settle in {WARM_UP_MINUTES:.0f}."
            )
    return tuple(f"{text} Check it by a drift measurement, or calibrate again." for text in found)
