"""The serial ports of this machine, and the projectors that answer on them."""

import contextlib
from dataclasses import dataclass

from serial.tools import list_ports

from app.rig.projectors import open_real_projector
from drivers.errors import DeviceError
from drivers.projector.open import DIALECTS
from drivers.projector.protocol import PowerState

# PJLink is a language of networks.
SERIAL_DIALECTS = tuple(name for name in DIALECTS if name != "pjlink")
_SAYS_NOTHING = (PowerState.SILENT, PowerState.FAULT)


@dataclass(frozen=True)
class FoundPort:
    """A serial port, as the system describes it."""

    device: str
    description: str


@dataclass(frozen=True)
class FoundProjector:
    """A projector that answered: its address, what it calls itself, and its power state."""

    url: str
    name: str
    power: str


def found_ports() -> list[FoundPort]:
    """Every serial port; none is opened."""
    return [FoundPort(port.device, str(port.description)) for port in list_ports.comports()]


def who_is_there(device: str) -> FoundProjector | None:
    """Ask a port in every language that projectors speak; None where nobody answers. Takes some seconds each.

    Only its power state and its name are asked for; nothing is switched.
    """
    for dialect in SERIAL_DIALECTS:
        url = f"{dialect}:{device}"
        with contextlib.suppress(DeviceError), open_real_projector(url) as projector:
            power = projector.power()
            if power not in _SAYS_NOTHING:
                status = projector.status()
                return FoundProjector(url, status.name or f"a projector that speaks {dialect}", str(power))
    return None
