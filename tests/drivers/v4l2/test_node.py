"""What can be known of the layer without a device; the rest runs under tests/hardware."""

import contextlib
import ctypes
import errno
import os

import numpy as np
import pytest

from drivers.errors import DeviceBusyError, DeviceNotFoundError, DeviceSettingError
from drivers.v4l2 import abi, list_devices
from drivers.v4l2.camera import V4l2Camera, V4l2Request, exposed_s
from drivers.v4l2.inventory import as_text
from drivers.v4l2.negotiation import negotiate_format, negotiate_period_s
from drivers.v4l2.node import Node, explain
from drivers.v4l2.stream import Filled, buffers_for


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
    assert abi.fourcc_text(0xA0363159) == "Y16-BE"  # the kernel's bit 31: bytes the other way round


def test_a_name_that_is_cut_off_inside_a_character_is_still_a_name():
    assert as_text("Kamera für Wände".encode()[:-4]) == "Kamera für W\ufffd"


def test_the_ring_has_room_for_a_moment_within_its_memory():
    assert buffers_for(640 * 480) == 32
    assert buffers_for(4096 * 3072 * 2) == 10
    assert buffers_for(200_000_000) == 4


class Granting(Node):
    """A driver that gives the format that it wants."""

    def __init__(self, path, pixel_format):
        super().__init__(path)
        self.gives = pixel_format

    def call(self, request, argument):
        assert request == abi.VIDIOC_S_FMT
        argument.fmt.pix.pixelformat = self.gives
        argument.fmt.pix.sizeimage = 2 * 640 * 480


def test_the_big_endian_kin_of_a_format_is_no_substitute_for_it(tmp_path):
    (tmp_path / "video0").write_bytes(b"")
    with contextlib.closing(Granting(tmp_path / "video0", abi.fourcc("Y16"))) as node:
        assert negotiate_format(node, "Y16", 640, 480).size_bytes == 614_400
    with contextlib.closing(Granting(tmp_path / "video0", abi.fourcc("Y16") | 1 << 31)) as node:
        with pytest.raises(DeviceSettingError, match="would give Y16-BE 640 x 480"):
            negotiate_format(node, "Y16", 640, 480)


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


def test_a_driver_that_knows_no_rate_leaves_it_unknown_and_one_that_is_asked_for_is_refused(tmp_path):
    (tmp_path / "video0").write_bytes(b"")
    node = Node(tmp_path / "video0")  # no file knows the request
    assert negotiate_period_s(node, None) is None
    with pytest.raises(DeviceSettingError, match="Leave frame_rate_hz out"):
        negotiate_period_s(node, 30.0)
    node.close()


def test_an_exposure_ends_before_the_stamp_unless_a_driver_stamps_its_start():
    def filled(flags):
        return Filled(np.zeros(1, np.uint8), 1, 10.0, flags)

    start, end = filled(abi.BUF_FLAG_TSTAMP_SRC_SOE), filled(0)
    assert exposed_s(start, 0.5, b"vivid") == 10.0
    assert exposed_s(end, 0.5, b"vivid") == 9.5
    # It stamps the arrival, and flags it as the start all the same.
    assert exposed_s(start, 0.5, b"uvcvideo") == 9.5
