"""A projector over a line: one request at a time, answers told from echoes and news, warm-up as a state."""

import threading
from typing import TypeVar

from drivers.clock import Clock, SystemClock
from drivers.errors import DeviceNotFoundError, DeviceRefusedError, DeviceTimeoutError
from drivers.projector.dialect import Answer, AnswerKind, Dialect, Request, Verb
from drivers.projector.lamp_guard import LampGuard
from drivers.projector.port import Port
from drivers.projector.protocol import Capability, PowerState, ProjectorStatus
from drivers.projector.wire_log import WireLog

T = TypeVar("T")
SLICE_S = 0.1
QUIET_S = 0.3
_ASKED = {
    Capability.SOURCE: Verb.ASK_SOURCE,
    Capability.MUTE: Verb.ASK_MUTE,
    Capability.FREEZE: Verb.ASK_FREEZE,
    Capability.LAMP_HOURS: Verb.ASK_HOURS,
    Capability.ERRORS: Verb.ASK_ERRORS,
    Capability.NAME: Verb.ASK_NAME,
}
_ALWAYS = (Capability.LAMP_HOURS, Capability.ERRORS, Capability.NAME)


class ProjectorLink:
    """The Protocol `Projector` for any dialect over any port. Opens the port when first asked."""

    def __init__(
        self, dialect: Dialect, port: Port, *, guard: LampGuard | None = None, clock: Clock | None = None
    ) -> None:
        self.log = WireLog()
        self._dialect, self._port = dialect, port
        self._guard, self._clock = guard or LampGuard(), clock or SystemClock()
        self._lock = threading.RLock()
        self._buffer, self._opened, self._suspect = b"", False, False
        self._absent: set[Verb] = set()
        self._switching: tuple[PowerState, float] | None = None
        self._lighting: Request | None = None

    @property
    def capabilities(self) -> frozenset[Capability]:
        """What the dialect can say, less what this model turned out not to know."""
        absent = {cap for cap, verb in _ASKED.items() if verb in self._absent}
        return self._dialect.capabilities - absent

    def power(self) -> PowerState:
        """Return the power state; within the manual's times, silence after a switch is a state too."""
        with self._lock:
            if self._lighting is not None and not self._lit():
                return PowerState.WARMING
            try:
                answer = self._ask(Request(Verb.ASK_POWER))
            except DeviceTimeoutError:
                return self._expected_state() or PowerState.SILENT
            if answer.kind is AnswerKind.BUSY:
                return self._expected_state() or PowerState.WARMING
            if isinstance(answer.value, PowerState):
                return self._note(answer.value)
            return PowerState.FAULT

    def status(self) -> ProjectorStatus:
        """Return everything that it says of itself; asks no further once it stops answering."""
        with self._lock:
            power = self.power()
            found: dict[Capability, object] = {}
            answering = power in (PowerState.ON, PowerState.STANDBY)
            for capability, verb in _ASKED.items():
                if not answering or (power is not PowerState.ON and capability not in _ALWAYS):
                    continue
                try:
                    answer = self._ask(Request(verb))
                except DeviceTimeoutError:
                    answering = False
                    continue
                if answer.kind is AnswerKind.VALUE:
                    found[capability] = answer.value
                elif answer.kind is AnswerKind.ABSENT and power is PowerState.ON:
                    self._absent.add(verb)
            return _status(power, found, self._guard.on_s)

    def turn_on(self) -> None:
        """Begin to light the lamp."""
        with self._lock:
            if self.power() in (PowerState.ON, PowerState.WARMING):
                return
            self._guard.may_light()
            request = Request(Verb.POWER_ON)
            if self._dialect.silent_start:
                self._light(request)
            else:
                self._command(request)
            self._guard.lit()
            self._switching = PowerState.WARMING, self._clock.now_s() + self._dialect.ignition_s

    def turn_off(self) -> None:
        """Begin to cool down."""
        with self._lock:
            state = self.power()
            if state in (PowerState.STANDBY, PowerState.COOLING):
                return
            if state is PowerState.WARMING:
                raise DeviceRefusedError(
                    "The projector is still warming up. Wait until it is lit: a lamp that is "
                    "put out while it ignites is damaged."
                )
            self._guard.may_put_out()
            self._command(Request(Verb.POWER_OFF))
            self._guard.put_out()
            self._switching = PowerState.COOLING, self._clock.now_s() + self._dialect.cooling_s

    def select_source(self, code: str) -> None:
        """Show another input."""
        if not code.isalnum() or len(code) > 16 or not code.isascii():
            raise DeviceRefusedError(f"{code!r} is no input's code. Use letters and digits as in the manual.")
        with self._lock:
            self._command(Request(Verb.SELECT_SOURCE, code))

    def mute(self, on: bool) -> None:
        """Make the picture black, or show it; verified by asking where that is possible."""
        with self._lock:
            self._command(Request(Verb.MUTE if on else Verb.UNMUTE))
            self._verify(Verb.ASK_MUTE, on)

    def freeze(self, on: bool) -> None:
        """Hold the picture, or let it go; verified by asking where that is possible."""
        with self._lock:
            self._command(Request(Verb.FREEZE if on else Verb.UNFREEZE))
            self._verify(Verb.ASK_FREEZE, on)

    def close(self) -> None:
        """Free the line."""
        with self._lock:
            self._port.close()
            self._opened = False

    def __enter__(self) -> "ProjectorLink":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _command(self, request: Request) -> None:
        if self._expected_state() is PowerState.WARMING and self.power() is PowerState.WARMING:
            raise DeviceRefusedError("The projector is still warming up. Wait until it is on, then repeat.")
        answer = self._exchange(request)
        if answer.kind is AnswerKind.DONE:
            return
        reason = {
            AnswerKind.ABSENT: "does not know this command or value; ask its status for what it knows",
            AnswerKind.BUSY: "is busy switching; wait a minute, then repeat",
        }.get(answer.kind, "refused; look at its indicators and at the wire log")
        raise DeviceRefusedError(f"The projector at {self._port.name} {reason} ({request.verb}).")

    def _verify(self, verb: Verb, wanted: bool) -> None:
        answer = self._ask(Request(verb))
        if answer.kind is AnswerKind.VALUE and answer.value is not wanted:
            raise DeviceRefusedError(
                f"The projector took the command but says {verb} {answer.value} instead of {wanted}. "
                "Repeat it; some models drop it while the signal changes."
            )

    def _ask(self, request: Request) -> Answer:
        if request.verb in self._absent:
            return Answer(AnswerKind.ABSENT)
        try:
            return self._exchange(request)
        except DeviceNotFoundError:
            return self._exchange(request)  # asking twice harms nothing; the line is opened again

    def _exchange(self, request: Request) -> Answer:
        """Send and wait for the answer. Raises DeviceTimeoutError, or DeviceNotFoundError for a lost line."""
        if self._dialect.encode(request) is None:
            return Answer(AnswerKind.ABSENT)
        self._send(request)
        deadline_s = self._clock.now_s() + self._dialect.timeout_s
        while self._clock.now_s() < deadline_s:
            answer = self._listen(request, SLICE_S)
            if answer is not None:
                return answer
        self._suspect = True
        raise DeviceTimeoutError(
            f"The projector at {self._port.name} did not answer {request.verb!s} within "
            f"{self._dialect.timeout_s:g} s. Check that it has power and that port and speed are right."
        )

    def _send(self, request: Request) -> None:
        try:
            if not self._opened:
                self._port.open()
                self._opened, self._buffer = True, b""
                self.log.add("!", f"opened {self._port.name}".encode())
            if self._suspect:
                self._settle()
            data = self._dialect.encode(request) or b""
            self.log.add(">", data)
            self._port.write(data)
        except DeviceNotFoundError:
            self._lose()
            raise

    def _settle(self) -> None:
        """Let a late answer pass: what comes now belongs to no request any more."""
        quiet_s = 0.0
        for _ in range(20):
            chunk = self._port.read(SLICE_S)
            self.log.add("<", chunk)
            quiet_s = 0.0 if chunk else quiet_s + SLICE_S
            if quiet_s >= QUIET_S:
                break
        self._buffer, self._suspect = b"", False

    def _listen(self, request: Request, timeout_s: float) -> Answer | None:
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
                self._note(answer.power)
            if answer.kind is not AnswerKind.OTHER:
                return answer
        return None

    def _lose(self) -> None:
        self._port.close()
        self._opened, self._buffer, self._lighting = False, b"", None
        self.log.add("!", b"line lost")

    def _lit(self) -> bool:
        """Return whether the answer to the lighting has come, or its time is over."""
        request = self._lighting
        if request is None:
            return True
        answer = self._listen(request, 0.0)
        if answer is None and self._expected_state() is PowerState.WARMING:
            return False
        self._lighting = None
        self._suspect = answer is None
        return True

    def _light(self, request: Request) -> None:
        """Send the lighting; only a refusal comes soon."""
        self._send(request)
        answer = self._listen(request, QUIET_S)
        if answer is not None and answer.kind is not AnswerKind.DONE:
            raise DeviceRefusedError(
                f"The projector at {self._port.name} refuses to light its lamp. "
                "Let it cool down, and look at its indicators."
            )
        self._lighting = request if answer is None else None

    def _expected_state(self) -> PowerState | None:
        if self._switching is None or self._clock.now_s() >= self._switching[1]:
            return None
        return self._switching[0]

    def _note(self, state: PowerState) -> PowerState:
        expected = self._expected_state()
        if state is PowerState.STANDBY and expected is PowerState.WARMING and not self._dialect.tells_warming:
            return expected  # "off" is all that it can say until it is lit
        if state in (PowerState.ON, PowerState.STANDBY):
            self._switching = None
        return state


def _status(power: PowerState, found: dict[Capability, object], on_s: float | None) -> ProjectorStatus:
    return ProjectorStatus(
        power,
        source=_typed(found.get(Capability.SOURCE), str),
        muted=_typed(found.get(Capability.MUTE), bool),
        frozen=_typed(found.get(Capability.FREEZE), bool),
        lamp_hours=_typed(found.get(Capability.LAMP_HOURS), int),
        errors=_typed(found.get(Capability.ERRORS), tuple) or (),
        name=_typed(found.get(Capability.NAME), str),
        on_s=on_s if power is PowerState.ON else None,
    )


def _typed(value: object, kind: type[T]) -> T | None:
    return value if isinstance(value, kind) else None
