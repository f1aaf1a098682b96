"""What can go wrong with a device, and what to do.

    DeviceError
    ├── DeviceNotFoundError      no such device, or it was unplugged
    ├── DeviceBusyError          another program holds it
    ├── DeviceTimeoutError       no answer in time
    ├── DeviceSettingError       a format or control was refused or silently changed
    ├── DeviceRefusedError       the device understood and said no (or said "not now")
    └── FrameError               a frame was dropped, corrupted, or late

Every message says what happened (with the value), what was expected, and what to do next.
"""

from enum import StrEnum


class DeviceError(Exception):
    """Any failure of a camera, projector or display."""


class DeviceNotFoundError(DeviceError):
    """The device is not there, or is gone."""


class DeviceBusyError(DeviceError):
    """Another program holds the device."""


class DeviceTimeoutError(DeviceError):
    """The device did not answer in time."""


class DeviceSettingError(DeviceError):
    """The device did not grant what was asked."""


class DeviceRefusedError(DeviceError):
    """The device answered that it will not do this, or not now."""


class FrameFault(StrEnum):
    """Why a frame is refused."""

    DROPPED = "dropped"
    CORRUPT = "corrupt"
    LATE = "late"
    STALE = "stale"
    MISSING = "missing"


class FrameError(DeviceError):
    """A frame was dropped, corrupted or late; it must not be used. `lost` frames are gone for good."""

    def __init__(self, message: str, fault: FrameFault = FrameFault.CORRUPT, lost: int = 1) -> None:
        super().__init__(message)
        self.fault = fault
        self.lost = lost
