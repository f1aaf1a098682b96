"""Cameras that the Linux kernel knows, by its own interface (Video for Linux): nothing between it and us."""

from drivers.v4l2.camera import V4l2Camera as V4l2Camera
from drivers.v4l2.camera import V4l2Request as V4l2Request
from drivers.v4l2.inventory import DeviceDescription as DeviceDescription
from drivers.v4l2.inventory import list_devices as list_devices
