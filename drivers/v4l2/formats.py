"""Bytes of a buffer to a grey image, never silently reduced to 8 bit. Pure functions."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from drivers.errors import DeviceSettingError, FrameError
from drivers.protocols import Pixels


@dataclass(frozen=True)
class Geometry:
    """Size as granted by the driver; `stride_bytes` from row to row, `size_bytes` of a buffer at most."""

    rows: int
    cols: int
    stride_bytes: int
    size_bytes: int = 0


@dataclass(frozen=True)
class PixelFormat:
    """A format that we read: `bits` are significant, `bytes_needed` is None where the size varies."""

    code: str
    bits: int
    decode: Callable[[np.ndarray, Geometry], Pixels]
    compressed: bool = False

    def bytes_needed(self, geometry: Geometry) -> int:
        """Return how many bytes a whole frame has at least."""
        return 1 if self.compressed else geometry.stride_bytes * geometry.rows


def pixel_format(code: str) -> PixelFormat:
    """Return the format of that code. Raises DeviceSettingError that lists the known ones."""
    known = {item.code: item for item in FORMATS}
    if code not in known:
        raise DeviceSettingError(f"Pixel format {code!r} is not read here; choose one of {', '.join(known)}.")
    return known[code]


def _rows(data: np.ndarray, geometry: Geometry) -> np.ndarray:
    whole = data[: geometry.stride_bytes * geometry.rows]
    return whole.reshape(geometry.rows, geometry.stride_bytes)


def _bytes(data: np.ndarray, geometry: Geometry) -> Pixels:
    return _rows(data, geometry)[:, : geometry.cols].copy()


def _words(data: np.ndarray, geometry: Geometry) -> Pixels:
    rows = _rows(data, geometry)[:, : 2 * geometry.cols]
    return np.ascontiguousarray(rows).view("<u2").astype(np.uint16, copy=False)


def _every_second(data: np.ndarray, geometry: Geometry) -> Pixels:
    return _rows(data, geometry)[:, : 2 * geometry.cols : 2].copy()


def _jpeg(data: np.ndarray, geometry: Geometry) -> Pixels:
    image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    if image is None or image.shape != (geometry.rows, geometry.cols):
        raise FrameError(
            f"A JPEG frame of {data.size} bytes could not be decoded to {geometry.cols} x {geometry.rows}. "
            "Use an uncompressed format if the camera has one."
        )
    return np.asarray(image, np.uint8)


FORMATS = (
    PixelFormat("GREY", 8, _bytes),
    PixelFormat("Y10", 10, _words),
    PixelFormat("Y12", 12, _words),
    PixelFormat("Y16", 16, _words),
    PixelFormat("YUYV", 8, _every_second),
    PixelFormat("NV12", 8, _bytes),
    PixelFormat("MJPG", 8, _jpeg, compressed=True),
)
