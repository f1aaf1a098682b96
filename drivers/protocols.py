"""What the rest of the program may ask of a camera: one narrow Protocol for real devices and twins."""

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8, UInt16

Pixels = UInt16[np.ndarray, "rows cols"] | UInt8[np.ndarray, "rows cols"]


@dataclass(frozen=True)
class Frame:
    """One raw frame as the camera gave it, never resampled.

    `full_scale_counts` is the largest count that the format can hold (4095 for 12 bit). `since_change` counts the
    frames between the first one after exposure or gain was changed and this one: the first of them may still have
    the old exposure. None where nothing was changed.
    """

    pixels: Pixels
    sequence: int
    timestamp_s: float
    full_scale_counts: int
    since_change: int | None = None


@dataclass(frozen=True)
class CameraInfo:
    """What is known of a camera: settings as read back from it, not as asked. A rate of None is unknown."""

    name: str
    width_px: int
    height_px: int
    bits: int
    frame_rate_hz: float | None
    settings: dict[str, float | int | str] = field(default_factory=dict)


@runtime_checkable
class Camera(Protocol):
    """An open camera. A context manager: leaving it stops the stream and frees the device."""

    @property
    def info(self) -> CameraInfo:
        """Identity, size and settings as read back."""
        ...

    @property
    def exposure_s(self) -> float | None:
        """Exposure time, read back from the device; None when it has no such control."""
        ...

    @exposure_s.setter
    def exposure_s(self, value: float) -> None: ...

    @property
    def gain(self) -> float | None:
        """Gain in the driver's own unit, read back from the device; None when it has no such control."""
        ...

    @gain.setter
    def gain(self, value: float) -> None: ...

    def grab(self) -> Frame:
        """Return the next frame whose exposure begins after this call.

        Raises FrameError for a dropped or corrupted frame, DeviceTimeoutError when none comes,
        DeviceNotFoundError when the camera is gone. The caller decides whether to try again.
        """
        ...

    def follow(self) -> Frame:
        """Return the frame that comes directly after the last returned one: bursts at the camera's rate.

        Raises as `grab` does; FrameError also when frames between the last one and this one were lost.
        """
        ...

    def reconnect(self) -> None:
        """Open the same device again with the same settings, after an unplug or a fatal error.

        Raises DeviceNotFoundError while it is still away. Needs no restart of the program.
        """
        ...

    def close(self) -> None:
        """Stop and free the device. Safe to call twice, also after an unplug."""
        ...

    def __enter__(self) -> "Camera": ...

    def __exit__(self, *exception: object) -> None: ...
