"""A GigE Vision or USB3 Vision camera: the same promises as a V4L2 camera's, and the same gate for every frame."""

import contextlib
import ctypes
import math
import time
from ctypes import byref, c_int, c_size_t
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from drivers.aravis.library import AUTO_OFF, CONTINUOUS, SUCCESS, AravisRefusedError, call, library, text
from drivers.errors import DeviceBusyError, DeviceNotFoundError, DeviceSettingError, DeviceTimeoutError
from drivers.gate import Arrival, FrameGate
from drivers.protocols import CameraInfo, Frame, Pixels
from drivers.settings import bits_of

BUFFERS = 16
# GigE Vision counts frames from 1 to this, and begins again.
LAST_SHORT_ID = 0xFFFF
# Significant bits by the format's name in the standard.
FORMATS = {"Mono16": 16, "Mono14": 14, "Mono12": 12, "Mono10": 10, "Mono8": 8}


@dataclass(frozen=True)
class AravisRequest:
    """What is asked of a camera. `device` is its id as listed, or its address on the network.

    `frame_rate_hz`, `exposure_s` and `gain` stay as they are when None. `bits` are the significant ones where a
    camera puts fewer into a wider format; None: the format's.
    """

    device: str
    width_px: int
    height_px: int
    pixel_format: str = "Mono8"
    frame_rate_hz: float | None = None
    exposure_s: float | None = None
    gain: float | None = None
    bits: int | None = None
    automatics_off: bool = True


class AravisCamera:
    """An open camera that streams. A context manager."""

    def __init__(self, request: AravisRequest) -> None:
        if request.pixel_format not in FORMATS:
            raise DeviceSettingError(
                f"Pixel format {request.pixel_format!r} is not read here; choose one of {', '.join(FORMATS)}."
            )
        self._request = request
        self._bits = bits_of(request.bits, request.pixel_format, FORMATS[request.pixel_format])
        self._camera: int | None = None
        self._stream: int | None = None
        self._open()

    @property
    def info(self) -> CameraInfo:
        """Identity, size and settings as the camera has them now."""
        settings: dict[str, float | int | str] = {"pixel_format": self._request.pixel_format}
        return CameraInfo(
            self._name,
            self._request.width_px,
            self._request.height_px,
            self._bits,
            None if self._gate.period_s is None else 1 / self._gate.period_s,
            settings,
        )

    @property
    def gate(self) -> FrameGate:
        """The gate, with its counts of refused frames."""
        return self._gate

    @property
    def exposure_s(self) -> float | None:
        """Exposure time as the camera has it; None when it has no such control."""
        if not self._ask("arv_camera_is_exposure_time_available"):
            return None
        return self._ask("arv_camera_get_exposure_time") * 1e-6

    @exposure_s.setter
    def exposure_s(self, value: float) -> None:
        before_s = self.exposure_s
        self._ask("arv_camera_set_exposure_time", 1e6 * value)
        self._check_granted("exposure", value, self.exposure_s)
        self._exposed_s = value
        if self.exposure_s != before_s:
            self._gate.note_change(value)

    @property
    def gain(self) -> float | None:
        """Gain in the camera's own unit; None when it has no such control."""
        if not self._ask("arv_camera_is_gain_available"):
            return None
        return float(self._ask("arv_camera_get_gain"))

    @gain.setter
    def gain(self, value: float) -> None:
        before = self.gain
        self._ask("arv_camera_set_gain", value)
        self._check_granted("gain", value, self.gain)
        if self.gain != before:
            self._gate.note_change(self.exposure_s)

    def grab(self) -> Frame:
        """Return the next frame whose exposure begins after this call."""
        called_s = time.monotonic()
        while True:
            arrival, data = self._next()
            if not self._gate.is_stale(arrival, called_s):
                return self._pass(arrival, data, consecutive=False)

    def follow(self) -> Frame:
        """Return the frame that comes directly after the last one."""
        arrival, data = self._next()
        return self._pass(arrival, data, consecutive=True)

    def reconnect(self) -> None:
        """Open the same camera again. Raises DeviceNotFoundError while it is away."""
        expected = self._name
        self.close()
        self._open()
        if self._name != expected:
            found = self._name
            self.close()
            raise DeviceNotFoundError(f"{self._request.device} is {found}, not {expected}. Plug that one in.")

    def close(self) -> None:
        """Stop and free the camera; also after an unplug."""
        camera, stream, self._camera, self._stream = self._camera, self._stream, None, None
        if camera is not None:
            with contextlib.suppress(AravisRefusedError):
                call("arv_camera_stop_acquisition", camera)
        for one in (stream, camera):
            if one is not None:
                library().g_object_unref(one)

    def __enter__(self) -> "AravisCamera":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _open(self) -> None:
        wanted = self._request
        try:
            self._camera = call("arv_camera_new", wanted.device.encode())
        except AravisRefusedError as error:
            raise _unopened(wanted.device, str(error)) from None
        try:
            self._name = identity(self._opened())
            self._apply_settings()
            self._start()
        except BaseException:
            self.close()
            raise

    def _apply_settings(self) -> None:
        wanted = self._request
        self._ask("arv_camera_set_pixel_format_from_string", wanted.pixel_format.encode())
        self._check_size(self._pair("arv_camera_get_sensor_size"), at_most=True)
        self._ask("arv_camera_set_region", 0, 0, wanted.width_px, wanted.height_px)
        self._check_size(self._pair("arv_camera_get_region", c_int(), c_int()), at_most=False)
        if wanted.automatics_off:
            self._switch_automatics_off()
        if wanted.frame_rate_hz is not None and self._ask("arv_camera_is_frame_rate_available"):
            self._ask("arv_camera_set_frame_rate", wanted.frame_rate_hz)
        self._gate = self._new_gate()
        if wanted.exposure_s is not None:
            self.exposure_s = wanted.exposure_s
        if wanted.gain is not None:
            self.gain = wanted.gain
        self._gate.note_change(self.exposure_s)

    def _new_gate(self) -> FrameGate:
        item = 1 if FORMATS[self._request.pixel_format] == 8 else 2
        known = self._ask("arv_camera_is_frame_rate_available")
        rate_hz = self._ask("arv_camera_get_frame_rate") if known else 0.0
        # The camera numbers every frame that it takes: a loss shows in the numbers. The library's stamps are those of
        # a busy machine, and tell nothing of it.
        return FrameGate(
            self._request.width_px * self._request.height_px * item,
            1 / rate_hz if rate_hz > 0 else None,
            late_factor=math.inf,
        )

    def _switch_automatics_off(self) -> None:
        for name, switch in (("exposure_auto", "exposure_time_auto"), ("gain_auto", "gain_auto")):
            if self._ask(f"arv_camera_is_{name}_available"):
                self._ask(f"arv_camera_set_{switch}", AUTO_OFF)

    def _start(self) -> None:
        self._ask("arv_camera_set_acquisition_mode", CONTINUOUS)
        payload = self._ask("arv_camera_get_payload")
        self._stream = self._ask("arv_camera_create_stream", None, None)
        for _ in range(BUFFERS):
            library().arv_stream_push_buffer(self._stream, library().arv_buffer_new_allocate(payload))
        self._last_id: int | None = None
        self._sequence = 0
        self._is_short = bool(library().arv_camera_is_gv_device(self._opened()))
        self._exposed_s = self.exposure_s or self._gate.period_s or 0.0
        self._ask("arv_camera_start_acquisition")

    def _next(self) -> tuple[Arrival, np.ndarray]:
        """The next buffer, its data copied, the buffer itself back in the ring."""
        timeout_s = self._gate.patience_s
        camera, stream = self._opened(), self._stream
        buffer = library().arv_stream_timeout_pop_buffer(stream, int(1e6 * timeout_s))
        if buffer is None:
            self._raise_silence(camera, timeout_s)
        try:
            return self._arrival(buffer), _data(buffer)
        finally:
            library().arv_stream_push_buffer(stream, buffer)

    def _arrival(self, buffer: int) -> Arrival:
        received_s = library().arv_buffer_get_system_timestamp(buffer) * 1e-9
        # The library's stamp is on the clock of the day; the gate's is monotonic.
        received_s += time.monotonic() - time.time()
        whole = library().arv_buffer_get_status(buffer) == SUCCESS
        size = c_size_t()
        library().arv_buffer_get_data(buffer, byref(size))
        sequence = self._counted(library().arv_buffer_get_frame_id(buffer))
        return Arrival(sequence, received_s - self._exposed_s, not whole, size.value)

    def _counted(self, frame_id: int) -> int:
        """The frame's number without the jump from the last short id to 1."""
        last, self._last_id = self._last_id, frame_id
        step = frame_id - (frame_id - 1 if last is None else last)
        if last is not None and step < 0 and self._is_short:
            step %= LAST_SHORT_ID
        self._sequence += step
        return self._sequence

    def _pass(self, arrival: Arrival, data: np.ndarray, *, consecutive: bool) -> Frame:
        self._gate.admit(arrival, consecutive=consecutive)
        pixels, full_scale = self._decoded(data), 2**self._bits - 1
        return Frame(pixels, arrival.sequence, arrival.exposed_s, full_scale, self._gate.since_change)

    def _decoded(self, data: np.ndarray) -> Pixels:
        rows, columns = self._request.height_px, self._request.width_px
        if FORMATS[self._request.pixel_format] == 8:
            return data[: rows * columns].reshape(rows, columns)
        return data[: 2 * rows * columns].view("<u2").astype(np.uint16, copy=False).reshape(rows, columns)

    def _raise_silence(self, camera: int, timeout_s: float) -> NoReturn:
        try:
            call("arv_camera_get_payload", camera)
        except AravisRefusedError as error:
            raise DeviceNotFoundError(
                f"{self._name} is gone ({error}). Plug it in; `reconnect` finds it again."
            ) from None
        raise DeviceTimeoutError(
            f"{self._name} sent no frame within {timeout_s:g} s. Check the cable, and that no trigger mode is on; "
            "then take the burst again."
        )

    def _check_size(self, has: tuple[int, int], *, at_most: bool) -> None:
        asked = self._request.width_px, self._request.height_px
        if asked == has or (at_most and asked[0] <= has[0] and asked[1] <= has[1]):
            return
        raise DeviceSettingError(
            f"{self._name} has {has[0]} x {has[1]} px; asked were {asked[0]} x {asked[1]}. State a size that it has: "
            "`airlens devices` lists its whole sensor."
        )

    def _pair(self, name: str, *before: c_int) -> tuple[int, int]:
        width, height = c_int(), c_int()
        self._ask(name, *map(byref, before), byref(width), byref(height))
        return width.value, height.value

    def _opened(self) -> int:
        if self._camera is None:
            raise DeviceNotFoundError(f"{self._request.device} is closed. Open it again with `reconnect`.")
        return self._camera

    def _ask(self, name: str, *arguments: object) -> Any:
        try:
            return call(name, self._opened(), *arguments)
        except AravisRefusedError as error:
            raise DeviceSettingError(f"{self._request.device} refused: {error}.") from None

    def _check_granted(self, what: str, asked: float, granted: float | None) -> None:
        if granted is None or abs(granted - asked) > 0.01 * asked:
            raise DeviceSettingError(
                f"{self._name} has {what} {granted}; asked was {asked:g}. State one that it grants."
            )


def identity(camera: int) -> str:
    """Vendor, model and serial number of an open camera."""
    parts = ("vendor_name", "model_name", "device_serial_number")
    return " ".join(text(call(f"arv_camera_get_{part}", camera)) for part in parts)


def _data(buffer: int) -> np.ndarray:
    """A copy of a buffer's bytes."""
    size = c_size_t()
    address = library().arv_buffer_get_data(buffer, byref(size))
    raw = (ctypes.c_uint8 * size.value).from_address(address)
    return np.frombuffer(memoryview(raw), np.uint8).copy()


def _unopened(device: str, reason: str) -> DeviceNotFoundError | DeviceBusyError:
    if "control" in reason.lower() or "access" in reason.lower():
        return DeviceBusyError(f"{device} is in use by another program ({reason}). Close that one.")
    return DeviceNotFoundError(
        f"There is no GigE Vision or USB3 Vision camera {device} ({reason}). Plug it in; `airlens devices` lists "
        "what is there."
    )
