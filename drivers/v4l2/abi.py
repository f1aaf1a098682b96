"""The kernel's structures and request numbers for video capture, for 64-bit Linux.

Source: include/uapi/linux/videodev2.h and v4l2-controls.h (names kept, so that they can be looked up).
"""

import ctypes
from ctypes import c_char, c_int32, c_int64, c_uint8, c_uint32, c_uint64, c_ulong

CAP_VIDEO_CAPTURE = 0x1
CAP_STREAMING = 0x4000000
CAP_DEVICE_CAPS = 0x80000000
BUF_TYPE_VIDEO_CAPTURE = 1
MEMORY_MMAP = 1
FIELD_NONE = 1
BUF_FLAG_ERROR = 0x40
BUF_FLAG_TIMESTAMP_MASK = 0xE000
BUF_FLAG_TIMESTAMP_MONOTONIC = 0x2000
BUF_FLAG_TSTAMP_SRC_MASK = 0x70000
BUF_FLAG_TSTAMP_SRC_SOE = 0x10000
FRMSIZE_TYPE_DISCRETE = 1
FRMIVAL_TYPE_DISCRETE = 1
CTRL_FLAG_DISABLED = 0x1
CTRL_FLAG_READ_ONLY = 0x4
CTRL_FLAG_INACTIVE = 0x10
CTRL_FLAG_NEXT_CTRL = 0x80000000
CTRL_TYPES = {1: "integer", 2: "boolean", 3: "menu", 4: "button", 8: "bitmask", 9: "integer menu"}

CID_AUTO_WHITE_BALANCE = 0x98090C
CID_AUTOGAIN = 0x980912
CID_GAIN = 0x980913
CID_HUE_AUTO = 0x980919
CID_AUTOBRIGHTNESS = 0x980920
CID_EXPOSURE_AUTO = 0x9A0901
CID_EXPOSURE_ABSOLUTE = 0x9A0902
CID_EXPOSURE_AUTO_PRIORITY = 0x9A0903
CID_FOCUS_AUTO = 0x9A090C
CID_ANALOGUE_GAIN = 0x9E0903
EXPOSURE_MANUAL = 1
EXPOSURE_UNIT_S = 100e-6


class DeviceCapability(ctypes.Structure):
    """`struct v4l2_capability`."""

    _fields_ = (
        ("driver", c_char * 16),
        ("card", c_char * 32),
        ("bus_info", c_char * 32),
        ("version", c_uint32),
        ("capabilities", c_uint32),
        ("device_caps", c_uint32),
        ("reserved", c_uint32 * 3),
    )


class FmtDesc(ctypes.Structure):
    """`struct v4l2_fmtdesc`."""

    _fields_ = (
        ("index", c_uint32),
        ("type", c_uint32),
        ("flags", c_uint32),
        ("description", c_char * 32),
        ("pixelformat", c_uint32),
        ("mbus_code", c_uint32),
        ("reserved", c_uint32 * 3),
    )


class PixFormat(ctypes.Structure):
    """`struct v4l2_pix_format`."""

    _fields_ = tuple(
        (name, c_uint32)
        for name in (
            *("width", "height", "pixelformat", "field", "bytesperline", "sizeimage"),
            *("colorspace", "priv", "flags", "ycbcr_enc", "quantization", "xfer_func"),
        )
    )


class _FormatUnion(ctypes.Union):
    _fields_ = (("pix", PixFormat), ("raw_data", c_uint8 * 200), ("align", c_uint64))


class Format(ctypes.Structure):
    """`struct v4l2_format`."""

    _fields_ = (("type", c_uint32), ("fmt", _FormatUnion))


class RequestBuffers(ctypes.Structure):
    """`struct v4l2_requestbuffers`."""

    _fields_ = (
        ("count", c_uint32),
        ("type", c_uint32),
        ("memory", c_uint32),
        ("capabilities", c_uint32),
        ("flags", c_uint32),
    )


class Buffer(ctypes.Structure):
    """`struct v4l2_buffer`."""

    _fields_ = (
        ("index", c_uint32),
        ("type", c_uint32),
        ("bytesused", c_uint32),
        ("flags", c_uint32),
        ("field", c_uint32),
        ("seconds", c_int64),
        ("microseconds", c_int64),
        ("timecode", c_uint32 * 4),
        ("sequence", c_uint32),
        ("memory", c_uint32),
        ("offset", c_ulong),
        ("length", c_uint32),
        ("reserved2", c_uint32),
        ("request_fd", c_int32),
    )


class Fract(ctypes.Structure):
    """`struct v4l2_fract`."""

    _fields_ = (("numerator", c_uint32), ("denominator", c_uint32))


class StreamParm(ctypes.Structure):
    """`struct v4l2_streamparm` for capture."""

    _fields_ = (
        ("type", c_uint32),
        ("capability", c_uint32),
        ("capturemode", c_uint32),
        ("timeperframe", Fract),
        ("rest", c_uint8 * 184),
    )


class FrmSizeEnum(ctypes.Structure):
    """`struct v4l2_frmsizeenum`; `size` is (width, height) when discrete, else min, max, step of each."""

    _fields_ = (
        ("index", c_uint32),
        ("pixel_format", c_uint32),
        ("type", c_uint32),
        ("size", c_uint32 * 6),
        ("reserved", c_uint32 * 2),
    )


class FrmIvalEnum(ctypes.Structure):
    """`struct v4l2_frmivalenum`; `interval` holds one fraction when discrete, else min, max, step."""

    _fields_ = (
        ("index", c_uint32),
        ("pixel_format", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("type", c_uint32),
        ("interval", Fract * 3),
        ("reserved", c_uint32 * 2),
    )


class QueryCtrl(ctypes.Structure):
    """`struct v4l2_queryctrl`."""

    _fields_ = (
        ("id", c_uint32),
        ("type", c_uint32),
        ("name", c_char * 32),
        ("minimum", c_int32),
        ("maximum", c_int32),
        ("step", c_int32),
        ("default_value", c_int32),
        ("flags", c_uint32),
        ("reserved", c_uint32 * 2),
    )


class Control(ctypes.Structure):
    """`struct v4l2_control`."""

    _fields_ = (("id", c_uint32), ("value", c_int32))


def _request(direction: int, number: int, kind: type) -> int:
    return direction << 30 | ctypes.sizeof(kind) << 16 | ord("V") << 8 | number


VIDIOC_QUERYCAP = _request(2, 0, DeviceCapability)
VIDIOC_ENUM_FMT = _request(3, 2, FmtDesc)
VIDIOC_S_FMT = _request(3, 5, Format)
VIDIOC_REQBUFS = _request(3, 8, RequestBuffers)
VIDIOC_QUERYBUF = _request(3, 9, Buffer)
VIDIOC_QBUF = _request(3, 15, Buffer)
VIDIOC_DQBUF = _request(3, 17, Buffer)
VIDIOC_STREAMON = _request(1, 18, c_int32)
VIDIOC_STREAMOFF = _request(1, 19, c_int32)
VIDIOC_G_PARM = _request(3, 21, StreamParm)
VIDIOC_S_PARM = _request(3, 22, StreamParm)
VIDIOC_G_CTRL = _request(3, 27, Control)
VIDIOC_S_CTRL = _request(3, 28, Control)
VIDIOC_QUERYCTRL = _request(3, 36, QueryCtrl)
VIDIOC_ENUM_FRAMESIZES = _request(3, 74, FrmSizeEnum)
VIDIOC_ENUM_FRAMEINTERVALS = _request(3, 75, FrmIvalEnum)


def fourcc(code: str) -> int:
    """Return the number of a four-letter pixel format; shorter names are filled up with spaces."""
    return int.from_bytes(code.ljust(4).encode("ascii"), "little")


def fourcc_text(number: int) -> str:
    """Return the name of a pixel format, without trailing spaces; the kernel's own "-BE" marks big-endian ones."""
    name = (number & 0x7FFFFFFF).to_bytes(4, "little").decode("ascii", "replace").rstrip()
    return f"{name}-BE" if number & 0x80000000 else name
