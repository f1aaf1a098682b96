"""What can happen to a simulated camera, frame by frame: a script is a function of the frame's number."""

from collections.abc import Callable
from enum import StrEnum


class CameraFault(StrEnum):
    """One mishap; the wire (buffers and their flags) shows it as a real driver does."""

    DROP = "drop"
    """The frame never arrives: the sequence number jumps."""
    SILENT_DROP = "silent drop"
    """The frame never arrives and the driver does not count it: only the timestamps jump."""
    ERROR_FLAG = "error flag"
    """Garbage, with the buffer's error flag set."""
    SHORT = "short buffer"
    """Half the bytes."""
    OLD_BUFFER = "old buffer"
    """The frame before is delivered once more."""
    STALL = "stall"
    """Nothing arrives until the driver's time is up."""
    UNPLUG = "unplug"
    """The device is gone until `reconnect`."""


FaultScript = Callable[[int], CameraFault | None]


def no_faults(sequence: int) -> CameraFault | None:
    """Return None: all is well."""
    return None
