"""The line to a projector: bytes with a time limit, and every way to lose it made one error."""

import contextlib
import socket
import termios
from typing import Protocol, runtime_checkable

import serial

from drivers.errors import DeviceBusyError, DeviceError, DeviceNotFoundError, DeviceTimeoutError

CONNECT_S = 3.0
WRITE_S = 2.0


@runtime_checkable
class Port(Protocol):
    """A line that is open or can be opened again. Raises DeviceNotFoundError when it is lost."""

    name: str

    def open(self) -> None:
        """Open, or open again. Raises DeviceNotFoundError or DeviceBusyError."""
        ...

    def write(self, data: bytes) -> None:
        """Send everything."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """Return what is there, after waiting for at most `timeout_s`; empty when nothing came."""
        ...

    def close(self) -> None:
        """Close; never raises."""
        ...


class SerialPort:
    """A serial line: 8N1, no flow control, held exclusively."""

    def __init__(self, device: str, baud: int = 9600) -> None:
        self.name = device
        self._baud = baud
        self._serial: serial.Serial | None = None

    def open(self) -> None:
        """Open the line. Raises DeviceBusyError when another program holds it."""
        self.close()
        try:
            self._serial = serial.Serial(
                self.name, self._baud, timeout=0, write_timeout=WRITE_S, exclusive=True
            )
        except (serial.SerialException, OSError, termios.error) as error:
            raise _unopened(self.name, error) from error

    def write(self, data: bytes) -> None:
        """Send everything."""
        try:
            self._open_line().write(data)
        except serial.SerialTimeoutException:
            raise DeviceTimeoutError(
                f"{self.name} took no bytes for {WRITE_S:g} s. "
                "Check that the cable is a null modem of RS-232 level."
            ) from None
        except (serial.SerialException, OSError, termios.error) as error:
            raise self._lost(error) from error

    def read(self, timeout_s: float) -> bytes:
        """Return what is there."""
        line = self._open_line()
        try:
            line.timeout = timeout_s
            first = line.read(1)
            return first + (line.read(line.in_waiting) if first else b"")
        except (serial.SerialException, OSError, termios.error) as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Close the line."""
        line, self._serial = self._serial, None
        if line is not None:
            with contextlib.suppress(serial.SerialException, OSError, termios.error):
                line.close()

    def _open_line(self) -> serial.Serial:
        if self._serial is None:
            raise DeviceNotFoundError(f"{self.name} is closed. Open it again.")
        return self._serial

    def _lost(self, error: Exception) -> DeviceError:
        self.close()
        return DeviceNotFoundError(
            f"{self.name} was lost ({error}). Plug the adapter in; it is opened again."
        )


class TcpPort:
    """A network line."""

    def __init__(self, host: str, port: int) -> None:
        self.name = f"{host}:{port}"
        self._address = (host, port)
        self._socket: socket.socket | None = None

    def open(self) -> None:
        """Connect."""
        self.close()
        try:
            self._socket = socket.create_connection(self._address, CONNECT_S)
        except OSError as error:
            raise _unopened(self.name, error) from error

    def write(self, data: bytes) -> None:
        """Send everything."""
        line = self._open_line()
        try:
            line.settimeout(WRITE_S)
            line.sendall(data)
        except OSError as error:
            raise self._lost(error) from error

    def read(self, timeout_s: float) -> bytes:
        """Return what is there."""
        line = self._open_line()
        try:
            line.settimeout(max(timeout_s, 1e-3))
            data = line.recv(65536)
        except TimeoutError:
            return b""
        except OSError as error:
            raise self._lost(error) from error
        if not data:
            raise self._lost(ConnectionError("the projector hung up"))
        return data

    def close(self) -> None:
        """Hang up."""
        line, self._socket = self._socket, None
        if line is not None:
            with contextlib.suppress(OSError):
                line.close()

    def _open_line(self) -> socket.socket:
        if self._socket is None:
            raise DeviceNotFoundError(f"{self.name} is not connected. Open it again.")
        return self._socket

    def _lost(self, error: Exception) -> DeviceError:
        self.close()
        return DeviceNotFoundError(f"{self.name} was lost ({error}). It is connected again when next asked.")


def _unopened(name: str, error: Exception) -> DeviceError:
    text = str(error)
    if "exclusively lock" in text or "busy" in text.lower():
        return DeviceBusyError(f"{name} is in use by another program. Close that program, then try again.")
    return DeviceNotFoundError(
        f"{name} cannot be opened ({text}). Check the cable, the name and your rights to it."
    )
