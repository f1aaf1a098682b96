"""What can go wrong with a device, and what to do.

    DeviceError
    ├── DeviceNotFoundError      no such device, or it was unplugged
    ├── DeviceBusyError          another program holds it
    ├── DeviceTimeoutError       no answer in time
    ├── DeviceSettingError       a format or control was refused or silently changed
    └── FrameError               a frame was dropped, corrupted, or late

Every message says what happened (with the value), what was expected, and what to do next.
"""


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


class FrameError(DeviceError):
    """A frame was dropped, corrupted or late; it must not be used."""
