"""Where a simulated projector lives: a pseudo-terminal, a TCP port, or right in this process."""

import contextlib
import os
import pty
import select
import socket
import threading
import tty
from pathlib import Path

from drivers.errors import DeviceNotFoundError
from drivers.simulated.projector.engine import SimulatedProjector

TICK_S = 0.005


class LoopPort:
    """A line inside the process, on the twin's own clock: an hour of warm-up costs nothing."""

    def __init__(self, projector: SimulatedProjector) -> None:
        self.name = "simulated projector"
        self._projector = projector
        self._clock = projector.responder.state.clock

    def open(self) -> None:
        """Connect."""
        self._projector.connect()

    def write(self, data: bytes) -> None:
        """Send everything."""
        self._check()
        self._projector.feed(data)

    def read(self, timeout_s: float) -> bytes:
        """Return what is due, after letting simulated time pass when nothing is."""
        data = self._projector.drain()
        if not data:
            self._check()
            self._clock.sleep_s(timeout_s)
            data = self._projector.drain()
        return data

    def close(self) -> None:
        """Nothing to free."""

    def _check(self) -> None:
        if self._projector.hung_up:
            raise DeviceNotFoundError("The simulated projector hung up. Open the line again.")


class PtyHost:
    """A projector behind a pseudo-terminal. `path` is a link that survives a hang-up."""

    def __init__(self, projector: SimulatedProjector, path: Path) -> None:
        self.path = path
        self._projector, self._stop = projector, threading.Event()
        self._open()
        self._thread = threading.Thread(target=self._run, name="simulated-projector", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop and remove the link."""
        self._stop.set()
        self._thread.join()
        self._shut()

    def __enter__(self) -> "PtyHost":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _open(self) -> None:
        # The slave end stays open here: without any slave the master reads an error.
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._slave))
        self._projector.connect()

    def _shut(self) -> None:
        self.path.unlink(missing_ok=True)
        for descriptor in (self._slave, self._master):
            os.close(descriptor)

    def _run(self) -> None:
        while not self._stop.is_set():
            readable, _, _ = select.select([self._master], [], [], TICK_S)
            if readable:
                self._projector.feed(os.read(self._master, 4096))
            data = self._projector.drain()
            if data:
                os.write(self._master, data)
            if self._projector.hung_up:
                self._shut()
                self._open()


class TcpHost:
    """A projector on a port of the loopback address; one line at a time, as most projectors."""

    def __init__(self, projector: SimulatedProjector) -> None:
        self._projector, self._stop = projector, threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(TICK_S)
        self.port: int = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._run, name="simulated-projector", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._stop.set()
        self._thread.join()
        self._listener.close()

    def __enter__(self) -> "TcpHost":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _run(self) -> None:
        while not self._stop.is_set():
            with contextlib.suppress(TimeoutError):
                line, _ = self._listener.accept()
                with line, contextlib.suppress(OSError):
                    self._serve(line)

    def _serve(self, line: socket.socket) -> None:
        self._projector.connect()
        line.settimeout(TICK_S)
        while not self._stop.is_set() and not self._projector.hung_up:
            line.sendall(self._projector.drain())
            with contextlib.suppress(TimeoutError):
                data = line.recv(4096)
                if not data:
                    return
                self._projector.feed(data)
            line.sendall(self._projector.drain())
