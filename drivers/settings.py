"""A camera's exposure and gain: set for good, or for one block that puts back what was there before.

Whoever opens a camera, and the operator who changes it, sets for good; whoever takes pictures holds.
"""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.errors import DeviceError, DeviceSettingError
from drivers.gate import CONTROL_FRAMES
from drivers.protocols import Camera, Frame


@dataclass(frozen=True)
class Setting:
    """A setting as asked for, and as the device has it (None: it has no such control)."""

    name: str
    asked: float | None
    granted: float | None


def set_on(camera: Camera, exposure_s: float | None, gain: float | None) -> None:
    """Set what is given from now on. Raises DeviceError when the camera refuses it."""
    if exposure_s is not None:
        camera.exposure_s = exposure_s
    if gain is not None:
        camera.gain = gain


@contextlib.contextmanager
def held(
    camera: Camera, exposure_s: float | None = None, gain: float | None = None
) -> Iterator[tuple[Setting, ...]]:
    """Set what is given, yield exposure and gain as granted, and put back what was there before.

    What is not given stays untouched. Raises DeviceError when the camera refuses a value; a camera that is
    lost meanwhile is told by its next use.
    """
    before = (camera.exposure_s, camera.gain)
    try:
        set_on(camera, exposure_s, gain)
        yield (
            Setting("exposure_s", exposure_s, camera.exposure_s),
            Setting("gain", gain, camera.gain),
        )
    finally:
        with contextlib.suppress(DeviceError):
            set_on(
                camera,
                None if exposure_s is None else before[0],
                None if gain is None else before[1],
            )


def bits_of(asked: int | None, pixel_format: str, holds: int) -> int:
    """Return the digits of a count: as asked, else what the format holds. Raises DeviceSettingError for more."""
    if asked is not None and asked > holds:
        raise DeviceSettingError(
            f"The pixel format {pixel_format} holds {holds} bits; asked were {asked}. State at most "
            f"{holds}, or choose another format."
        )
    return holds if asked is None else asked


def is_settled(frame: Frame) -> bool:
    """Return whether a frame was taken with the settings that its camera has: cameras obey some frames late."""
    return frame.since_change is None or frame.since_change >= CONTROL_FRAMES


def grab_settled(camera: Camera) -> Frame:
    """Return a fresh frame that was taken with the settings that the camera has. Raises as `Camera.grab` does."""
    frame = camera.grab()
    while not is_settled(frame):
        frame = camera.grab()
    return frame


def check_granted(settings: tuple[Setting, ...]) -> None:
    """Raise DeviceSettingError for a setting that the camera has otherwise than asked."""
    for one in settings:
        if one.asked is None:
            continue
        if one.granted is None or abs(one.granted - one.asked) > 0.01 * abs(one.asked) + 1e-4:
            raise DeviceSettingError(
                f"{one.name} is {one.granted} after {one.asked:g} was asked for. "
                "Choose a value that the camera has, and switch its automatic control off."
            )
