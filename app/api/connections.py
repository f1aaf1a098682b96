"""Connections that send nothing are ended: a time for headers, a pace for bodies, and room for others.

A caller may open thousands of connections and say nothing, or one byte at a time. Each would hold a file of
this process until nobody else gets in. Here the oldest silent ones make room for new ones, so that a reader
who asks at once is answered however many are held open.
"""

import asyncio
import resource
from collections import Counter
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from app.api.security.guard import STREAMS

# Headers come in one packet; this is for the slowest line.
HEADERS_S = 10.0
# A body may take so long, and longer by what came at this pace (a modem's is 7 kB/s).
BODY_S = 20.0
PACE_BYTES_PER_S = 5_000.0
HEADERS_BYTES = 64 * 1024
# Files that the service needs for itself: ledger, devices, workers, files that are read.
OWN_FILES = 96
MOST = 1024
SHARE = 0.75


def most_connections() -> int:
    """How many connections the process has files for, at most 1024."""
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return max(16, min(MOST, int(0.7 * (files - OWN_FILES))))


class Gate:
    """Counts a server's connections; the oldest that waits for its caller makes room for a new one."""

    def __init__(self, most: int | None = None) -> None:
        self.most = most_connections() if most is None else most
        self._clients: Counter[str] = Counter()
        self._open: dict[PatientProtocol, str] = {}
        # In the order in which they began to wait.
        self._waiting: dict[PatientProtocol, str] = {}

    def enter(self, connection: "PatientProtocol", client: str) -> bool:
        """Whether there is room, after one was ended where there was none."""
        one_client_has_its_share = self._clients[client] >= SHARE * self.most
        if one_client_has_its_share or len(self._open) >= self.most:
            wanted = client if one_client_has_its_share else None
            oldest = next((c for c, whose in self._waiting.items() if wanted in (None, whose)), None)
            if oldest is None:
                return False
            oldest.end()
        self._open[connection] = client
        self._clients[client] += 1
        return True

    def waits(self, connection: "PatientProtocol") -> None:
        """The caller is to send something."""
        if connection in self._open:
            self._waiting[connection] = self._open[connection]

    def works(self, connection: "PatientProtocol") -> None:
        """The service is to answer: not ended for others."""
        self._waiting.pop(connection, None)

    def leave(self, connection: "PatientProtocol") -> None:
        """The connection is closed, or becomes a stream that the guard counts."""
        self._waiting.pop(connection, None)
        client = self._open.pop(connection, None)
        if client is not None:
            self._clients[client] -= 1
            self._clients += Counter()


class PatientProtocol(HttpToolsProtocol):
    """HTTP with limits on how long a caller may take to ask."""

    def __init__(self, gate: Gate, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._gate = gate
        self._limit: asyncio.TimerHandle | None = None
        self._in_headers = True
        self._asked_bytes = 0
        self._began_s = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for headers, if there is room."""
        super().connection_made(transport)
        if not self._gate.enter(self, self.client[0] if self.client else "local"):
            self.end()
            return
        self._wait_for_headers()

    def connection_lost(self, exc: Exception | None) -> None:
        """Make room."""
        self._stop()
        self._gate.leave(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Parse what came; headers without an end are refused."""
        if self._limit is None:
            self._wait_for_headers()  # the next request of a connection that was kept
        self._asked_bytes += len(data)
        super().data_received(data)
        if self._in_headers and self._asked_bytes > HEADERS_BYTES:
            self.end()

    def on_headers_complete(self) -> None:
        """Answer; the body must keep its pace."""
        self._stop()
        self._in_headers = False
        self._gate.works(self)
        super().on_headers_complete()
        self._began_s, self._asked_bytes = self.loop.time(), 0
        self._limit = self.loop.call_later(BODY_S, self._look)

    def on_message_complete(self) -> None:
        """Everything was asked."""
        self._stop()
        super().on_message_complete()

    def on_response_complete(self) -> None:
        """Wait for the next request; a silent caller makes room for others."""
        self._gate.waits(self)
        super().on_response_complete()

    def handle_websocket_upgrade(self) -> None:
        """Hand over; the guard counts streams."""
        self._stop()
        self._gate.leave(self)
        super().handle_websocket_upgrade()

    def shutdown(self) -> None:
        """The service stops: an answer without an end is ended, another one is finished."""
        super().shutdown()
        if self.cycle is not None and not self.cycle.response_complete and self.scope["path"] in STREAMS:
            self.transport.close()

    def end(self) -> None:
        """Close at once, and make room."""
        self._stop()
        self._gate.leave(self)
        self.transport.abort()

    def _wait_for_headers(self) -> None:
        self._gate.waits(self)
        self._in_headers, self._asked_bytes = True, 0
        self._limit = self.loop.call_later(HEADERS_S, self.end)

    def _look(self) -> None:
        """End a body that came too slowly; look again later at one that did not."""
        late_s = self.loop.time() - self._began_s - BODY_S
        if self._asked_bytes < late_s * PACE_BYTES_PER_S or (late_s > 0 and not self._asked_bytes):
            self.end()
        else:
            self._limit = self.loop.call_later(1.0, self._look)

    def _stop(self) -> None:
        if self._limit is not None:
            self._limit.cancel()
            self._limit = None
