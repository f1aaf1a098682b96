"""What cameras there are, and what each can do: formats, sizes, rates, controls."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import DeviceError
from drivers.v4l2 import abi
from drivers.v4l2.controls import ControlDescription, Controls
from drivers.v4l2.node import Node


@dataclass(frozen=True)
class SizeDescription:
    """A size with its frame rates [Hz]; ranges are given by their end points."""

    width_px: int
    height_px: int
    rates_hz: tuple[float, ...]


@dataclass(frozen=True)
class FormatDescription:
    """A pixel format by its four-letter code, the driver's words for it, and its sizes."""

    code: str
    description: str
    sizes: tuple[SizeDescription, ...]


@dataclass(frozen=True)
class DeviceDescription:
    """A camera as the kernel describes it. `error` says why the rest is missing."""

    path: Path
    name: str
    driver: str
    bus: str
    formats: tuple[FormatDescription, ...] = ()
    controls: tuple[ControlDescription, ...] = ()
    error: str = ""


def list_devices(folder: Path = Path("/dev")) -> list[DeviceDescription]:
    """Return every node that can capture, sorted by number; one that cannot be opened says why."""
    nodes = sorted(folder.glob("video*"), key=lambda path: (len(path.name), path.name))
    return [found for path in nodes if (found := describe_device(path)) is not None]


def describe_device(path: Path) -> DeviceDescription | None:
    """Return what `path` can do, or None when it is no capture device."""
    try:
        node = Node(path)
    except DeviceError as error:
        return DeviceDescription(path, path.name, "", "", error=str(error))
    with contextlib.closing(node):
        try:
            about = query(node)
            if not captures(about):
                return None
            formats = tuple(_formats(node))
            controls = tuple(Controls(node).descriptions.values())
        except DeviceError as error:
            return DeviceDescription(path, path.name, "", "", error=str(error))
    return DeviceDescription(
        path, as_text(about.card), as_text(about.driver), as_text(about.bus_info), formats, controls
    )


def query(node: Node) -> abi.DeviceCapability:
    """Return the driver's identity and capabilities."""
    about = abi.DeviceCapability()
    node.call(abi.VIDIOC_QUERYCAP, about)
    return about


def as_text(name: bytes) -> str:
    """Return a driver's name for something; it may be cut off inside a character."""
    return name.decode("utf-8", "replace")


def captures(about: abi.DeviceCapability) -> bool:
    """Return whether this very node (not another of the same device) streams video in."""
    own = about.device_caps if about.capabilities & abi.CAP_DEVICE_CAPS else about.capabilities
    return bool(own & abi.CAP_VIDEO_CAPTURE and own & abi.CAP_STREAMING)


def _formats(node: Node) -> Iterator[FormatDescription]:
    def ask(index: int) -> abi.FmtDesc:
        return abi.FmtDesc(index=index, type=abi.BUF_TYPE_VIDEO_CAPTURE)

    for item in node.enumerate(abi.VIDIOC_ENUM_FMT, ask):
        code = abi.fourcc_text(item.pixelformat)
        yield FormatDescription(
            code, item.description.decode("utf-8", "replace"), tuple(_sizes(node, item.pixelformat))
        )


def _sizes(node: Node, pixel_format: int) -> Iterator[SizeDescription]:
    def ask(index: int) -> abi.FrmSizeEnum:
        return abi.FrmSizeEnum(index=index, pixel_format=pixel_format)

    for item in node.enumerate(abi.VIDIOC_ENUM_FRAMESIZES, ask):
        size = list(item.size)
        discrete = item.type == abi.FRMSIZE_TYPE_DISCRETE
        pairs = [(size[0], size[1])] if discrete else [(size[0], size[3]), (size[1], size[4])]
        for width, height in pairs:
            yield SizeDescription(width, height, tuple(_rates(node, pixel_format, width, height)))
        if not discrete:
            return


def _rates(node: Node, pixel_format: int, width: int, height: int) -> Iterator[float]:
    def ask(index: int) -> abi.FrmIvalEnum:
        return abi.FrmIvalEnum(index=index, pixel_format=pixel_format, width=width, height=height)

    for item in node.enumerate(abi.VIDIOC_ENUM_FRAMEINTERVALS, ask):
        discrete = item.type == abi.FRMIVAL_TYPE_DISCRETE
        for interval in item.interval[:1] if discrete else item.interval[:2]:
            yield interval.denominator / max(interval.numerator, 1)
        if not discrete:
            return
