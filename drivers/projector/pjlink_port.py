"""A network line that greets as PJLink demands: the first command of each connection carries the digest."""

from drivers.clock import Clock, SystemClock
from drivers.errors import DeviceNotFoundError, DeviceRefusedError
from drivers.projector.pjlink import greeting_digest
from drivers.projector.port import Port

GREETING_S = 4.0


class PjLinkPort:
    """Wraps a line; `password` may be empty where the projector wants none."""

    def __init__(self, line: Port, password: str = "", clock: Clock | None = None) -> None:
        self.name = line.name
        self._clock = clock or SystemClock()
        self._line, self._password = line, password
        self._prefix = b""

    def open(self) -> None:
        """Connect and read the greeting. Raises DeviceRefusedError without the password that is wanted."""
        self._line.open()
        greeting, deadline_s = b"", self._clock.now_s() + GREETING_S
        while b"\r" not in greeting and self._clock.now_s() < deadline_s and len(greeting) < 100:
            greeting += self._line.read(0.2)
        try:
            digest = greeting_digest(greeting.strip(b"\r\n"), self._password)
        except ValueError as error:
            self._line.close()
            raise DeviceRefusedError(str(error)) from None
        if digest is None:
            self._line.close()
            raise DeviceNotFoundError(
                f"{self.name} greeted with {greeting[:40]!r} instead of PJLINK. "
                "Check the address; another service may live there."
            )
        self._prefix = digest

    def write(self, data: bytes) -> None:
        """Send everything, the first time with the digest before it."""
        prefix, self._prefix = self._prefix, b""
        self._line.write(prefix + data)

    def read(self, timeout_s: float) -> bytes:
        """Return what is there."""
        return self._line.read(timeout_s)

    def close(self) -> None:
        """Hang up."""
        self._line.close()
