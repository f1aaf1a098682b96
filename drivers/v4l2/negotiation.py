"""Format, size and rate: asked for, read back, and refused when the driver would give something else."""

from drivers.errors import DeviceSettingError
from drivers.v4l2 import abi
from drivers.v4l2.formats import Geometry
from drivers.v4l2.node import Node


def negotiate_format(node: Node, code: str, width_px: int, height_px: int) -> Geometry:
    """Return the geometry of the format that was asked for. Raises DeviceSettingError for a substitute."""
    ask = abi.Format(type=abi.BUF_TYPE_VIDEO_CAPTURE)
    pix = ask.fmt.pix
    pix.width, pix.height, pix.field = width_px, height_px, abi.FIELD_NONE
    pix.pixelformat = abi.fourcc(code)
    node.call(abi.VIDIOC_S_FMT, ask)
    granted = f"{abi.fourcc_text(pix.pixelformat)} {pix.width} x {pix.height}"
    asked = f"{code} {width_px} x {height_px}"
    if granted != asked or pix.field != abi.FIELD_NONE:
        raise DeviceSettingError(
            f"{node.path} would give {granted} (field order {pix.field}) instead of {asked}. "
            "Ask for a format and size that `airlens devices` lists."
        )
    return Geometry(pix.height, pix.width, pix.bytesperline, pix.sizeimage)


def negotiate_period_s(node: Node, rate_hz: float | None) -> float | None:
    """Return the time from frame to frame, None where the driver does not say; sets the rate when one is given.

    Raises DeviceSettingError.
    """
    parameters = abi.StreamParm(type=abi.BUF_TYPE_VIDEO_CAPTURE)
    if rate_hz is not None:
        parameters.timeperframe = abi.Fract(1000, round(1000 * rate_hz))
        if not node.knows(abi.VIDIOC_S_PARM, parameters):
            raise DeviceSettingError(f"{node.path} has no frame rate to set. Leave frame_rate_hz out.")
    if not node.knows(abi.VIDIOC_G_PARM, parameters):
        return None
    period = parameters.timeperframe
    if not period.numerator or not period.denominator:
        return None if rate_hz is None else 1 / rate_hz
    granted_hz = period.denominator / period.numerator
    if rate_hz is not None and abs(granted_hz - rate_hz) > 0.01 * rate_hz:
        raise DeviceSettingError(
            f"{node.path} would run at {granted_hz:g} Hz instead of {rate_hz:g} Hz. "
            "Ask for a rate that `airlens devices` lists for this size."
        )
    return period.numerator / period.denominator
