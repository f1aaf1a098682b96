"""A projector from one line of text: `escvp21:/dev/ttyUSB0`, `pjlink://192.168.1.5`, `nec://10.0.0.4`."""

from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from drivers.errors import DeviceSettingError
from drivers.projector.benq import BenQ
from drivers.projector.dialect import Dialect
from drivers.projector.escvp21 import EscVp21
from drivers.projector.lamp_guard import LampGuard
from drivers.projector.link import ProjectorLink
from drivers.projector.nec import Nec
from drivers.projector.optoma import Optoma
from drivers.projector.pjlink import PjLink
from drivers.projector.pjlink_port import PjLinkPort
from drivers.projector.port import Port, SerialPort, TcpPort

DIALECTS: dict[str, type] = {kind.name: kind for kind in (EscVp21, PjLink, BenQ, Optoma, Nec)}
# What serial adapters offer.
LOWEST_BAUD, HIGHEST_BAUD = 50, 4_000_000
_TCP_PORTS = {"pjlink": 4352, "nec": 7142, "optoma": 23, "benq": 8000, "escvp21": 3629}


def open_projector(url: str, *, password: str = "", journal: Path | None = None) -> ProjectorLink:
    """Return the projector at `url`; the line opens when it is first asked. `journal` keeps the lamp's times.

    Raises DeviceSettingError for text that names no dialect or no line.
    """
    try:
        parts = urlsplit(url)
        (parts.hostname or "").encode("idna")
    except ValueError as error:
        raise DeviceSettingError(
            f"{url!r} is no address ({error}). Write it as pjlink://192.168.1.5."
        ) from None
    if parts.scheme not in DIALECTS or not (parts.path or parts.hostname):
        raise DeviceSettingError(
            f"{url!r} names no projector; expected DIALECT:/dev/ttyUSB0 or DIALECT://address, "
            f"with DIALECT one of {', '.join(DIALECTS)}."
        )
    dialect: Dialect = DIALECTS[parts.scheme]()
    return ProjectorLink(dialect, _port(url, password), guard=LampGuard(journal=journal))


def _port(url: str, password: str) -> Port:
    parts = urlsplit(url)
    try:
        baud = int(parse_qs(parts.query).get("baud", ["9600"])[0])
        number = parts.port or _TCP_PORTS[parts.scheme]
        if not LOWEST_BAUD <= baud <= HIGHEST_BAUD:
            raise ValueError(f"baud is {baud}, expected {LOWEST_BAUD} to {HIGHEST_BAUD}")
    except ValueError as error:
        raise DeviceSettingError(f"{url!r}: {error}. Give whole numbers for baud and port.") from None
    if not parts.hostname:
        return SerialPort(parts.path, baud)
    if parts.scheme == "escvp21":
        raise DeviceSettingError(
            f"{url!r}: ESC/VP21 is spoken here over a serial line. "
            "For the network use pjlink://, which Epson has too."
        )
    line = TcpPort(parts.hostname, number)
    return PjLinkPort(line, password) if parts.scheme == "pjlink" else line
