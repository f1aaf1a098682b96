"""Cameras by GigE Vision and USB3 Vision, through the system's Aravis library where it is installed."""

from drivers.aravis.camera import AravisCamera, AravisRequest
from drivers.aravis.inventory import AravisDescription, list_aravis
from drivers.aravis.library import is_installed

__all__ = ["AravisCamera", "AravisDescription", "AravisRequest", "is_installed", "list_aravis"]
