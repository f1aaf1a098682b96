"""The Aravis library of the system, by ctypes: its functions with their types, and its errors as ours.

Source: the reference of Aravis 0.8. Nothing is loaded before the first camera is looked for.
"""

import ctypes
import functools
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_uint64, c_void_p
from ctypes.util import find_library
from typing import Any

from drivers.errors import DeviceNotFoundError, DeviceSettingError

NAME = "libaravis-0.8.so.0"
CONTINUOUS = 0
AUTO_OFF = 0
# arv_buffer_get_status: a whole frame.
SUCCESS = 0


class _Error(ctypes.Structure):
    _fields_ = (("domain", c_uint), ("code", c_int), ("message", c_char_p))


_ERROR = POINTER(POINTER(_Error))
# What a function returns and takes; one that can fail takes a GError last.
_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "arv_update_device_list": (None, ()),
    "arv_get_n_devices": (c_uint, ()),
    "arv_get_device_id": (c_char_p, (c_uint,)),
    "arv_get_device_vendor": (c_char_p, (c_uint,)),
    "arv_get_device_model": (c_char_p, (c_uint,)),
    "arv_get_device_address": (c_char_p, (c_uint,)),
    "arv_camera_new": (c_void_p, (c_char_p, _ERROR)),
    "arv_camera_get_vendor_name": (c_char_p, (c_void_p, _ERROR)),
    "arv_camera_get_model_name": (c_char_p, (c_void_p, _ERROR)),
    "arv_camera_get_device_serial_number": (c_char_p, (c_void_p, _ERROR)),
    "arv_camera_get_sensor_size": (None, (c_void_p, POINTER(c_int), POINTER(c_int), _ERROR)),
    "arv_camera_set_region": (None, (c_void_p, c_int, c_int, c_int, c_int, _ERROR)),
    "arv_camera_get_region": (
        None,
        (c_void_p, POINTER(c_int), POINTER(c_int), POINTER(c_int), POINTER(c_int), _ERROR),
    ),
    "arv_camera_dup_available_pixel_formats_as_strings": (c_void_p, (c_void_p, POINTER(c_uint), _ERROR)),
    "arv_camera_set_pixel_format_from_string": (None, (c_void_p, c_char_p, _ERROR)),
    "arv_camera_get_pixel_format_as_string": (c_char_p, (c_void_p, _ERROR)),
    "arv_camera_is_exposure_time_available": (c_int, (c_void_p, _ERROR)),
    "arv_camera_is_exposure_auto_available": (c_int, (c_void_p, _ERROR)),
    "arv_camera_set_exposure_time_auto": (None, (c_void_p, c_int, _ERROR)),
    "arv_camera_set_exposure_time": (None, (c_void_p, c_double, _ERROR)),
    "arv_camera_get_exposure_time": (c_double, (c_void_p, _ERROR)),
    "arv_camera_is_gain_available": (c_int, (c_void_p, _ERROR)),
    "arv_camera_is_gain_auto_available": (c_int, (c_void_p, _ERROR)),
    "arv_camera_set_gain_auto": (None, (c_void_p, c_int, _ERROR)),
    "arv_camera_set_gain": (None, (c_void_p, c_double, _ERROR)),
    "arv_camera_get_gain": (c_double, (c_void_p, _ERROR)),
    "arv_camera_is_frame_rate_available": (c_int, (c_void_p, _ERROR)),
    "arv_camera_set_frame_rate": (None, (c_void_p, c_double, _ERROR)),
    "arv_camera_get_frame_rate": (c_double, (c_void_p, _ERROR)),
    "arv_camera_set_acquisition_mode": (None, (c_void_p, c_int, _ERROR)),
    "arv_camera_get_payload": (c_uint, (c_void_p, _ERROR)),
    "arv_camera_create_stream": (c_void_p, (c_void_p, c_void_p, c_void_p, _ERROR)),
    "arv_camera_start_acquisition": (None, (c_void_p, _ERROR)),
    "arv_camera_stop_acquisition": (None, (c_void_p, _ERROR)),
    "arv_camera_is_gv_device": (c_int, (c_void_p,)),
    "arv_stream_push_buffer": (None, (c_void_p, c_void_p)),
    "arv_stream_timeout_pop_buffer": (c_void_p, (c_void_p, c_uint64)),
    "arv_buffer_new_allocate": (c_void_p, (c_size_t,)),
    "arv_buffer_get_status": (c_int, (c_void_p,)),
    "arv_buffer_get_data": (c_void_p, (c_void_p, POINTER(c_size_t))),
    "arv_buffer_get_frame_id": (c_uint64, (c_void_p,)),
    "arv_buffer_get_system_timestamp": (c_uint64, (c_void_p,)),
    "g_object_unref": (None, (c_void_p,)),
    "g_free": (None, (c_void_p,)),
    "g_error_free": (None, (c_void_p,)),
}


@functools.cache
def library() -> ctypes.CDLL:
    """The loaded library. Raises DeviceNotFoundError where it is not installed."""
    try:
        loaded = ctypes.CDLL(find_library("aravis-0.8") or NAME)
    except OSError:
        raise DeviceNotFoundError(
            "GigE Vision and USB3 Vision cameras need the library Aravis, which is not installed. On Debian: "
            "apt install libaravis-0.8-0"
        ) from None
    for name, (returns, takes) in _SIGNATURES.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = returns, takes
    return loaded


def is_installed() -> bool:
    """Whether the library is there."""
    try:
        library()
    except DeviceNotFoundError:
        return False
    return True


class AravisRefusedError(DeviceSettingError):
    """The library or the camera refused; the message is the library's own."""


def call(name: str, *arguments: Any) -> Any:
    """Call a function that can fail. Raises AravisRefusedError with what the library says."""
    error = POINTER(_Error)()
    found = getattr(library(), name)(*arguments, byref(error))
    if error:
        text = (error.contents.message or b"").decode("utf-8", "replace")
        library().g_error_free(error)
        raise AravisRefusedError(text)
    return found


def text(raw: bytes | None) -> str:
    """A text of the library; empty for none."""
    return (raw or b"").decode("utf-8", "replace")
