"""Requests and answers over a line: answers told from echoes, news and late replies, within a time limit."""

from drivers.clock import Clock
from drivers.errors import DeviceNotFoundError, DeviceTimeoutError
from drivers.projector.dialect import Answer, AnswerKind, Dialect, Request
from drivers.projector.port import Port
from drivers.projector.protocol import PowerState
from drivers.projector.wire_log import WireLog

SLICE_S = 0.1
QUIET_S = 0.3
DOUBT_S = 10.0
BUDGET_S = 8.0


class Exchange:
    """One line with one dialect. `news` is the last power state that a message told unasked.

    `begin` starts a time budget that all exchanges until the next `begin` share: no call of the projector's
    user takes longer, whatever goes wrong on the way.
    """

    def __init__(self, dialect: Dialect, port: Port, clock: Clock) -> None:
        self.log = WireLog()
        self.name = port.name
        self.news: PowerState | None = None
        self._dialect, self._port, self._clock = dialect, port, clock
        self._buffer, self._opened, self._suspect = b"", False, False
        self._doubt_until_s = self._ends_s = float("-inf")

    @property
    def in_doubt(self) -> bool:
        """Whether a late answer to an earlier request may still come."""
        return self._clock.now_s() < self._doubt_until_s

    def begin(self) -> None:
        """Start a new time budget."""
        self._ends_s = self._clock.now_s() + BUDGET_S

    def ask(self, request: Request) -> Answer:
        """Return an answer that is certain: in doubt, or when refused, two in a row must agree."""
        doubtful, before = self.in_doubt, None
        while True:
            answer = self.exchange_again(request)
            refused = answer.kind in (AnswerKind.ABSENT, AnswerKind.FAILED)
            if answer == before or not (doubtful or refused):
                return answer
            before = answer

    def exchange(self, request: Request) -> Answer:
        """Send and wait for the answer. Raises DeviceTimeoutError, or DeviceNotFoundError for a lost line."""
        if self._dialect.encode(request) is None:
            return Answer(AnswerKind.ABSENT)
        self.send(request)
        deadline_s = min(self._clock.now_s() + self._dialect.timeout_s, self._ends_s)
        while self._clock.now_s() < deadline_s:
            answer = self.listen(request, SLICE_S)
            if answer is not None:
                return answer
        self.doubt()
        raise DeviceTimeoutError(
            f"The projector at {self.name} did not answer {request.verb!s} within "
            f"{self._dialect.timeout_s:g} s. Check that it has power and that port and speed are right."
        )

    def exchange_again(self, request: Request) -> Answer:
        """Exchange what may be sent twice: once more over a new line where the old one is lost.

        Projectors hang up when nobody asked for a while.
        """
        try:
            return self.exchange(request)
        except DeviceNotFoundError:
            return self.exchange(request)

    def send(self, request: Request) -> None:
        """Send a request; what came before it is dropped."""
        try:
            if not self._opened:
                self._port.open()
                self._opened = True
                self.log.add("!", f"opened {self.name}".encode())
            self._drop_old()
            data = self._dialect.encode(request) or b""
            self.log.add(">", data)
            self._port.write(data)
        except DeviceNotFoundError:
            self._lose()
            raise

    def listen(self, request: Request, timeout_s: float) -> Answer | None:
        """Return the answer if it comes in time."""
        try:
            chunk = self._port.read(timeout_s)
        except DeviceNotFoundError:
            self._lose()
            raise
        self.log.add("<", chunk)
        messages, self._buffer = self._dialect.split(self._buffer + chunk, idle=not chunk)
        self._buffer = self._buffer[-4096:]
        for message in messages:
            answer = self._dialect.decode(request, message)
            if answer.power is not None and not request.verb.asks:
                self.news = answer.power
            if answer.kind is not AnswerKind.OTHER:
                return answer
        return None

    def doubt(self) -> None:
        """Note that an answer is still owed."""
        self._suspect, self._doubt_until_s = True, self._clock.now_s() + DOUBT_S

    def close(self) -> None:
        """Free the line."""
        self._port.close()
        self._opened = False

    def _drop_old(self) -> None:
        """Drop what belongs to no request any more; after a time-out, wait until the line is quiet."""
        quiet_s, ends_s = 0.0, self._clock.now_s() + 2.0
        while self._clock.now_s() < ends_s:
            chunk = self._port.read(SLICE_S if self._suspect else 0.0)
            self.log.add("<", chunk)
            quiet_s = 0.0 if chunk else quiet_s + SLICE_S
            if not chunk and (not self._suspect or quiet_s >= QUIET_S):
                break
        self._buffer, self._suspect = b"", False

    def _lose(self) -> None:
        self._port.close()
        self._opened, self._buffer = False, b""
        self.log.add("!", b"line lost")
