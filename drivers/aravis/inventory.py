"""Which GigE Vision and USB3 Vision cameras there are, and the grey formats of each."""

import ctypes
from ctypes import byref, c_int, c_uint
from dataclasses import dataclass

from drivers.aravis.camera import FORMATS
from drivers.aravis.library import AravisRefusedError, call, is_installed, library, text


@dataclass(frozen=True)
class AravisDescription:
    """A camera: its id, its name, its address, its whole sensor, its grey formats. `error` says why these lack."""

    device: str
    name: str
    address: str
    width_px: int = 0
    height_px: int = 0
    formats: tuple[str, ...] = ()
    error: str = ""


def list_aravis() -> list[AravisDescription]:
    """Every camera that answers within a second; none where the library is not installed."""
    if not is_installed():
        return []
    arv = library()
    arv.arv_update_device_list()
    return [_described(number) for number in range(arv.arv_get_n_devices())]


def _described(number: int) -> AravisDescription:
    arv = library()
    device = text(arv.arv_get_device_id(number))
    name = f"{text(arv.arv_get_device_vendor(number))} {text(arv.arv_get_device_model(number))}"
    address = text(arv.arv_get_device_address(number))
    try:
        camera = call("arv_camera_new", device.encode())
    except AravisRefusedError as error:
        return AravisDescription(device, name, address, error=f"It cannot be opened: {error}.")
    try:
        width, height = c_int(), c_int()
        call("arv_camera_get_sensor_size", camera, byref(width), byref(height))
        return AravisDescription(device, name, address, width.value, height.value, _formats(camera))
    except AravisRefusedError as error:
        return AravisDescription(device, name, address, error=f"It does not describe itself: {error}.")
    finally:
        arv.g_object_unref(camera)


def _formats(camera: int) -> tuple[str, ...]:
    """The formats that are read here, the deepest first."""
    count = c_uint()
    names = call("arv_camera_dup_available_pixel_formats_as_strings", camera, byref(count))
    try:
        found = ctypes.cast(names, ctypes.POINTER(ctypes.c_char_p))[: count.value]
    finally:
        library().g_free(names)
    known = {text(name) for name in found}
    return tuple(name for name in FORMATS if name in known)
