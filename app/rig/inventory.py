"""The cameras that a new experiment may choose from: what is plugged in, and one that computes its pictures."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from drivers.aravis import AravisDescription, list_aravis
from drivers.aravis.camera import FORMATS as ARAVIS_FORMATS
from drivers.v4l2 import list_devices
from drivers.v4l2.formats import FORMATS
from drivers.v4l2.inventory import DeviceDescription

CameraKind = Literal["v4l2", "aravis", "simulated"]


@dataclass(frozen=True)
class FormatChoice:
    """A grey format that airlens reads, at one size."""

    pixel_format: str
    bits: int
    width_px: int
    height_px: int

    @property
    def text(self) -> str:
        """As a person chooses it: `Y16 1920x1200`."""
        return f"{self.pixel_format} {self.width_px}x{self.height_px}"


@dataclass(frozen=True)
class CameraChoice:
    """A camera and what it would be asked for: its deepest grey format at its largest size, the first of all."""

    kind: CameraKind
    device: str
    name: str
    pixel_format: str
    bits: int
    width_px: int
    height_px: int
    error: str = ""
    formats: tuple[FormatChoice, ...] = ()


# What stands in the list for a simulated camera that looks at an uploaded room.
_IN_AN_UPLOAD = "Simulated camera in the uploaded room"
SIMULATED = CameraChoice("simulated", "", "Simulated camera in the packaged room", "", 12, 384, 288)


def found_cameras(folder: Path = Path("/dev")) -> Sequence[CameraChoice]:
    """Every camera of the kernel, of the network and of USB3 Vision, then the simulated one."""
    return [*map(_v4l2, list_devices(folder)), *map(_aravis, list_aravis()), SIMULATED]


def simulated_in(uploads: Sequence[str]) -> list[CameraChoice]:
    """A simulated camera for each uploaded room, which it looks at; `device` is the upload."""
    return [replace(SIMULATED, device=upload, name=f"{_IN_AN_UPLOAD} {upload}") for upload in uploads]


def _v4l2(found: DeviceDescription) -> CameraChoice:
    depths = {one.code: one.bits for one in FORMATS}
    offered = {
        FormatChoice(one.code, depths[one.code], size.width_px, size.height_px)
        for one in found.formats
        for size in one.sizes
        if one.code in depths
    }
    return _choice("v4l2", str(found.path), found.name, offered, found.error)


def _aravis(found: AravisDescription) -> CameraChoice:
    offered = {
        FormatChoice(name, ARAVIS_FORMATS[name], found.width_px, found.height_px) for name in found.formats
    }
    name = f"{found.name} ({found.address})" if found.address else found.name
    return _choice("aravis", found.device, name, offered, found.error)


def _choice(
    kind: CameraKind, device: str, name: str, offered: Collection[FormatChoice], error: str
) -> CameraChoice:
    if not offered:
        reason = error or "It has no format that airlens reads. Choose another camera."
        return CameraChoice(kind, device, name, "", 0, 0, 0, reason)
    ordered = sorted(
        offered, key=lambda one: (one.bits, one.width_px * one.height_px, one.text), reverse=True
    )
    best = ordered[0]
    return CameraChoice(
        kind,
        device,
        name,
        best.pixel_format,
        best.bits,
        best.width_px,
        best.height_px,
        formats=tuple(ordered),
    )
