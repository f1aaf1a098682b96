"""What can be known of the layer without a device; the rest runs under tests/hardware."""

import ctypes
import errno
import os

import pytest

from drivers.errors import DeviceBusyError, DeviceNotFoundError, DeviceSettingError
from drivers.v4l2 import abi, list_devices
from drivers.v4l2.camera import V4l2Camera, V4l2Request
from drivers.v4l2.node import explain


@pytest.mark.parametrize(
    ("structure", "size"),
    [
        (abi.DeviceCapability, 104),
        (abi.FmtDesc, 64),
        (abi.Format, 208),
        (abi.RequestBuffers, 20),
        (abi.Buffer, 88),
        (abi.StreamParm, 204),
        (abi.FrmSizeEnum, 44),
        (abi.FrmIvalEnum, 52),
        (abi.QueryCtrl, 68),
        (abi.Control, 8),
    ],
)
def test_structures_have_the_kernels_sizes(structure, size):
    # sizeof() of a C program against linux/videodev2.h on x86-64.
    assert ctypes.sizeof(structure) == size


def test_request_numbers_are_the_kernels():
    # From strace of v4l2-ctl.
    assert abi.VIDIOC_QUERYCAP == 0x80685600
    assert abi.VIDIOC_DQBUF == 0xC0585611
    assert abi.VIDIOC_STREAMON == 0x40045612


def test_pixel_codes_are_four_letters():
    assert abi.fourcc("Y16") == 0x20363159
    assert abi.fourcc_text(0x20363159) == "Y16"


@pytest.mark.parametrize(
    ("number", "kind", "text"),
    [
        (errno.EBUSY, DeviceBusyError, "in use by another program"),
        (errno.ENODEV, DeviceNotFoundError, "Plug the camera in"),
        (errno.EACCES, DeviceNotFoundError, "group 'video'"),
        (errno.EINVAL, DeviceSettingError, "airlens devices"),
    ],
)
def test_error_numbers_become_advice(number, kind, text, tmp_path):
    found = explain(OSError(number, os.strerror(number)), tmp_path / "video0")
    assert type(found) is kind
    assert text in str(found)


def test_an_absent_camera_is_said_and_an_empty_folder_has_none(tmp_path):
    with pytest.raises(DeviceNotFoundError, match="airlens devices"):
        V4l2Camera(V4l2Request(tmp_path / "video0", 640, 480))
    assert list_devices(tmp_path) == []
    (tmp_path / "video3").write_bytes(b"")
    found = list_devices(tmp_path)[0]
    assert "refused a request" in found.error
