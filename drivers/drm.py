"""A pattern without browser or desktop: one buffer of the kernel's display driver, scanned out as it is.

Needs a graphics card on which no desktop runs (being its master). Source: include/uapi/drm/drm_mode.h.
"""

import contextlib
import ctypes
import errno
import fcntl
import mmap
import os
from ctypes import c_char, c_uint16, c_uint32, c_uint64
from pathlib import Path

import numpy as np

from drivers.display import Picture, picture_digest
from drivers.errors import DeviceBusyError, DeviceError, DeviceNotFoundError, DeviceSettingError

CONNECTED = 1
SET_MASTER = ord("d") << 8 | 0x1E


def _words(*names: str) -> tuple[tuple[str, type], ...]:
    return tuple((name, c_uint32) for name in names)


def _longs(*names: str) -> tuple[tuple[str, type], ...]:
    return tuple((name, c_uint64) for name in names)


class _Resources(ctypes.Structure):
    _fields_ = (
        *_longs("fbs", "crtcs", "connectors", "encoders"),
        *_words("count_fbs", "count_crtcs", "count_connectors", "count_encoders"),
        *_words("min_width", "max_width", "min_height", "max_height"),
    )


class _Mode(ctypes.Structure):
    _fields_ = (
        ("clock", c_uint32),
        ("hdisplay", c_uint16),
        ("horizontal", c_uint16 * 4),
        ("vdisplay", c_uint16),
        ("vertical", c_uint16 * 4),
        *_words("vrefresh", "flags", "type"),
        ("name", c_char * 32),
    )


class _Connector(ctypes.Structure):
    _fields_ = (
        *_longs("encoders", "modes", "props", "prop_values"),
        *_words("count_modes", "count_props", "count_encoders", "encoder_id", "connector_id"),
        *_words("connector_type", "connector_type_id", "connection", "mm_width", "mm_height"),
        *_words("subpixel", "pad"),
    )


class _Crtc(ctypes.Structure):
    _fields_ = (
        ("connectors", c_uint64),
        *_words("count_connectors", "crtc_id", "fb_id", "x", "y", "gamma_size", "mode_valid"),
        ("mode", _Mode),
    )


class _CreateDumb(ctypes.Structure):
    _fields_ = (*_words("height", "width", "bpp", "flags", "handle", "pitch"), ("size", c_uint64))


class _MapDumb(ctypes.Structure):
    _fields_ = (*_words("handle", "pad"), ("offset", c_uint64))


class _AddFb(ctypes.Structure):
    _fields_ = _words("fb_id", "width", "height", "pitch", "bpp", "depth", "handle")


class _Dirty(ctypes.Structure):
    _fields_ = (*_words("fb_id", "flags", "color", "num_clips"), ("clips", c_uint64))


class DrmDisplay:
    """A PatternDisplay on the first connected output of a card, in that output's preferred mode."""

    def __init__(self, card: Path = Path("/dev/dri/card0")) -> None:
        self._card, self._digest = card, ""
        try:
            self._descriptor = os.open(card, os.O_RDWR)
        except OSError as error:
            raise DeviceNotFoundError(
                f"{card} cannot be opened ({error.strerror}). Name another card."
            ) from None
        try:
            self._become_master()
            self._connector, self._mode = self._connected()
            self._crtc = self._first_crtc()
            self._scan_out()
        except BaseException:
            self.close()
            raise

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of the output."""
        return self._mode.vdisplay, self._mode.hdisplay

    def show(self, picture: Picture) -> str:
        """Return the digest once the buffer that is scanned out holds the picture."""
        if picture.shape != self.size:
            rows, cols = self.size
            raise DeviceSettingError(
                f"The picture is {picture.shape[1]} x {picture.shape[0]} and the output {cols} x {rows}. "
                "Make the pattern of the projector's native size, or set the output to it."
            )
        pixels = self._pixels()
        pixels[..., :3] = picture[..., None]
        pixels[..., 3] = 0
        with contextlib.suppress(DeviceError):  # only drivers that copy the buffer out know this request
            self._call(0xB1, _Dirty(fb_id=self._fb.fb_id))
        self._digest = picture_digest(np.ascontiguousarray(pixels[..., 1]))
        return self._digest

    def is_showing(self, digest: str) -> bool:
        """Return whether the output still scans our buffer out, with that picture in it."""
        now = _Crtc(crtc_id=self._crtc)
        self._call(0xA1, now)
        return digest == self._digest and now.fb_id == self._fb.fb_id and bool(now.mode_valid)

    def close(self) -> None:
        """Give the card back; the kernel removes the buffer with it."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def __enter__(self) -> "DrmDisplay":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _call(self, number: int, argument: ctypes.Structure) -> None:
        request = 3 << 30 | ctypes.sizeof(argument) << 16 | ord("d") << 8 | number
        try:
            fcntl.ioctl(self._descriptor, request, argument)
        except OSError as error:
            raise DeviceSettingError(
                f"{self._card} refused request {number:#x} ({error.strerror}). Use the kiosk page instead."
            ) from error

    def _become_master(self) -> None:
        try:
            fcntl.ioctl(self._descriptor, SET_MASTER)
        except OSError as error:
            if error.errno in (errno.EBUSY, errno.EACCES, errno.EPERM, errno.EINVAL):
                raise DeviceBusyError(
                    f"A desktop has {self._card} ({error.strerror}). "
                    "Use the kiosk page, or a card without desktop."
                ) from None
            raise

    def _connected(self) -> tuple[int, _Mode]:
        for number in self._list("connectors", "count_connectors"):
            seen = _Connector(connector_id=number)
            self._call(0xA7, seen)
            if seen.connection != CONNECTED or not seen.count_modes:
                continue
            modes = (_Mode * seen.count_modes)()
            asked = _Connector(
                connector_id=number, count_modes=seen.count_modes, modes=ctypes.addressof(modes)
            )
            self._call(0xA7, asked)
            return number, modes[0]  # the kernel puts the preferred mode first
        raise DeviceNotFoundError(f"No screen is connected to {self._card}. Plug the projector in.")

    def _first_crtc(self) -> int:
        return self._list("crtcs", "count_crtcs")[0]

    def _list(self, field: str, count: str) -> list[int]:
        asked = _Resources()
        self._call(0xA0, asked)
        numbers = (c_uint32 * getattr(asked, count))()
        found = _Resources(**{field: ctypes.addressof(numbers), count: len(numbers)})
        self._call(0xA0, found)
        return list(numbers)

    def _scan_out(self) -> None:
        rows, cols = self.size
        self._dumb = _CreateDumb(height=rows, width=cols, bpp=32)
        self._call(0xB2, self._dumb)
        pitch, handle = self._dumb.pitch, self._dumb.handle
        self._fb = _AddFb(width=cols, height=rows, pitch=pitch, bpp=32, depth=24, handle=handle)
        self._call(0xAE, self._fb)
        where = _MapDumb(handle=handle)
        self._call(0xB3, where)
        self._map = mmap.mmap(self._descriptor, self._dumb.size, offset=where.offset)
        connectors = (c_uint32 * 1)(self._connector)
        self._call(
            0xA2,
            _Crtc(
                connectors=ctypes.addressof(connectors),
                count_connectors=1,
                crtc_id=self._crtc,
                fb_id=self._fb.fb_id,
                mode_valid=1,
                mode=self._mode,
            ),
        )

    def _pixels(self) -> np.ndarray:
        rows, cols = self.size
        whole = np.frombuffer(self._map, np.uint8, self._dumb.pitch * rows).reshape(rows, self._dumb.pitch)
        return whole[:, : 4 * cols].reshape(rows, cols, 4)
