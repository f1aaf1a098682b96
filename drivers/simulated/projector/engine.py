"""A responder with its line: replies leave when they are due, and whatever the script says goes wrong."""

from collections.abc import Callable
from enum import StrEnum

import numpy as np

from drivers.simulated.projector.responder import Responder


class ProjectorFault(StrEnum):
    """One mishap, at one command."""

    SILENCE = "silence"
    ERROR = "error"
    GARBAGE = "garbage"
    """Random bytes in place of the reply."""
    NOISE = "noise"
    """Random bytes before the reply."""
    NEWS = "news"
    """A message that nobody asked for before the reply."""
    TRUNCATED = "truncated"
    LATE = "late"
    """The reply comes 7 s later."""
    HANG_UP = "hang up"
    """The line is closed instead of a reply."""


ProjectorScript = Callable[[int], ProjectorFault | None]
LATE_S = 7.0


class SimulatedProjector:
    """Feed it bytes, drain what is due. `seed` makes the garbage."""

    def __init__(
        self, responder: Responder, faults: ProjectorScript = lambda _: None, *, seed: int = 0
    ) -> None:
        self.responder, self.commands = responder, 0
        self._hung_up, self._heard_s = False, responder.state.clock.now_s()
        self._faults, self._random = faults, np.random.default_rng(seed)
        self._buffer = b""
        self._outbox: list[tuple[float, bytes]] = []

    @property
    def hung_up(self) -> bool:
        """Whether it has closed the line: by a mishap, or because nothing came over it for a while."""
        idle_s, now_s = self.responder.idle_s, self.responder.state.clock.now_s()
        return self._hung_up or (idle_s is not None and now_s - self._heard_s > idle_s)

    def connect(self) -> None:
        """A line opens."""
        self._hung_up, self._buffer, self._outbox = False, b"", []
        self._heard_s = self.responder.state.clock.now_s()
        self._send(self.responder.greeting())

    def feed(self, data: bytes) -> None:
        """Take in bytes from the line."""
        self._heard_s = self.responder.state.clock.now_s()
        commands, self._buffer = self.responder.split(self._buffer + data)
        for command in commands:
            fault = self._faults(self.commands)
            self.commands += 1
            self._respond(command, fault)

    def drain(self) -> bytes:
        """Return what is due to leave now."""
        now_s = self.responder.state.clock.now_s()
        due = [data for at_s, data in self._outbox if at_s <= now_s]
        self._outbox = [item for item in self._outbox if item[0] > now_s]
        return b"".join(due)

    def _respond(self, command: bytes, fault: ProjectorFault | None) -> None:
        if fault is ProjectorFault.HANG_UP:
            self._hung_up = True
            return
        if fault is ProjectorFault.SILENCE:
            return
        if fault is ProjectorFault.ERROR:
            self._send(self.responder.error)
            return
        if fault is ProjectorFault.GARBAGE:
            self._send(self._noise())
            return
        if fault is ProjectorFault.NOISE:
            self._send(self._noise())
        if fault is ProjectorFault.NEWS:
            self._send(self.responder.news)
        for reply in self.responder.respond(command):
            late_s = LATE_S if fault is ProjectorFault.LATE else 0.0
            cut = len(reply.data) // 2 if fault is ProjectorFault.TRUNCATED else len(reply.data)
            self._send(reply.data[:cut], reply.delay_s + late_s)

    def _send(self, data: bytes, delay_s: float = 0.0) -> None:
        if data:
            # A busy projector answers in order: nothing overtakes a late reply.
            last_s = self._outbox[-1][0] if self._outbox else float("-inf")
            self._outbox.append((max(last_s, self.responder.state.clock.now_s() + delay_s), data))

    def _noise(self) -> bytes:
        # Above ASCII: what a wrong level or a loose plug makes of text, and never a message by accident.
        return self._random.integers(
            0x80, 0xFF, size=int(self._random.integers(1, 30)), dtype=np.uint8
        ).tobytes()
