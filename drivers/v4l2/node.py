"""One open device node: requests to the kernel, whose error numbers become errors that say what to do."""

import ctypes
import errno
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from drivers.errors import DeviceBusyError, DeviceError, DeviceNotFoundError, DeviceSettingError

S = TypeVar("S", bound=ctypes.Structure)
GONE = (errno.ENODEV, errno.ENXIO, errno.ENOENT, errno.EIO)


class Node:
    """An open `/dev/videoN`. `close` is safe at any time, also after an unplug."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        except OSError as error:
            raise explain(error, path) from None

    def call(self, request: int, argument: ctypes.Structure | ctypes.c_int32) -> None:
        """Send one request; `argument` is read and filled in. Raises a DeviceError."""
        try:
            fcntl.ioctl(self.descriptor, request, argument)
        except OSError as error:
            raise explain(error, self.path) from error

    def knows(self, request: int, argument: ctypes.Structure) -> bool:
        """Send one request as `call` does; return False where the driver does not know it at all."""
        try:
            self.call(request, argument)
        except DeviceError as error:
            if isinstance(error.__cause__, OSError) and error.__cause__.errno == errno.ENOTTY:
                return False
            raise
        return True

    def enumerate(self, request: int, make: Callable[[int], S]) -> Iterator[S]:
        """Yield the answers to a request that counts its `index` up until the kernel says EINVAL."""
        index = 0
        while True:
            item = make(index)
            try:
                fcntl.ioctl(self.descriptor, request, item)
            except OSError as error:
                if error.errno in (errno.EINVAL, errno.ENOTTY):
                    return
                raise explain(error, self.path) from error
            yield item
            index += 1

    def close(self) -> None:
        """Close the node."""
        descriptor, self.descriptor = self.descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def explain(error: OSError, path: Path) -> DeviceError:
    """Return the DeviceError for an error number of the kernel."""
    if error.errno == errno.EBUSY:
        return DeviceBusyError(f"{path} is in use by another program. Close that program, then try again.")
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeviceNotFoundError(
            f"{path} may not be opened by this user. Add the user to the group 'video' and log in again."
        )
    if error.errno in GONE:
        return DeviceNotFoundError(
            f"{path} is not there ({os.strerror(error.errno)}). "
            "Plug the camera in; `airlens devices` lists what is."
        )
    return DeviceSettingError(
        f"{path} refused a request ({os.strerror(error.errno or 0)}). "
        "Ask for a format and settings that `airlens devices` lists."
    )
