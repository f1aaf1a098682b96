"""A projector over a line: one request at a time, warm-up as a state, the lamp guarded, sets verified."""

import threading
from collections import Counter
from typing import TypeVar

from drivers.clock import Clock, SystemClock
from drivers.errors import DeviceNotFoundError, DeviceRefusedError, DeviceTimeoutError
from drivers.projector.dialect import AnswerKind, Dialect, Request, Verb
from drivers.projector.exchange import QUIET_S, Exchange
from drivers.projector.lamp_guard import LampGuard
from drivers.projector.port import Port
from drivers.projector.protocol import Capability, PowerState, ProjectorStatus
from drivers.projector.wire_log import WireLog

T = TypeVar("T")
ABSENT_AFTER = 2
_ASKED = {
    Capability.SOURCE: Verb.ASK_SOURCE,
    Capability.MUTE: Verb.ASK_MUTE,
    Capability.FREEZE: Verb.ASK_FREEZE,
    Capability.LAMP_HOURS: Verb.ASK_HOURS,
    Capability.ERRORS: Verb.ASK_ERRORS,
    Capability.NAME: Verb.ASK_NAME,
}
_IN_STANDBY = (Capability.LAMP_HOURS, Capability.ERRORS, Capability.NAME)
_REASONS = {
    AnswerKind.ABSENT: "does not know this command or value; ask its status for what it knows",
    AnswerKind.BUSY: "is busy switching; wait a minute, then repeat",
    AnswerKind.DENIED: "does not accept the password; set AIRLENS_PROJECTOR_PASSWORD to the projector's own",
    AnswerKind.FAILED: "refused; look at its indicators and at the wire log",
}


class ProjectorLink:
    """The Protocol `Projector` for any dialect over any port. Opens the port when first asked."""

    def __init__(
        self, dialect: Dialect, port: Port, *, guard: LampGuard | None = None, clock: Clock | None = None
    ) -> None:
        self._clock = clock or SystemClock()
        self._dialect, self._guard = dialect, guard or LampGuard()
        self._line = Exchange(dialect, port, self._clock)
        self._lock = threading.RLock()
        self._unknown: Counter[Verb] = Counter()
        self._switching: tuple[PowerState, float] | None = None
        self._lighting = False

    @property
    def log(self) -> WireLog:
        """Every byte that went over the line."""
        return self._line.log

    @property
    def capabilities(self) -> frozenset[Capability]:
        """What the dialect can say, less what this model turned out not to know."""
        absent = {cap for cap, verb in _ASKED.items() if self._unknown[verb] >= ABSENT_AFTER}
        return self._dialect.capabilities - absent

    def power(self) -> PowerState:
        """Return the power state; within the manual's times, silence after a switch is a state too."""
        with self._lock:
            self._line.begin()
            return self._power()

    def status(self) -> ProjectorStatus:
        """Return everything that it says of itself; asks no further once it stops answering."""
        with self._lock:
            self._line.begin()
            power = self._power()
            on_s = self._guard.on_s if power is PowerState.ON else None
            if power not in (PowerState.ON, PowerState.STANDBY):
                return ProjectorStatus(power)
            return _status(power, self._ask_all(_ASKED if power is PowerState.ON else _IN_STANDBY), on_s)

    def turn_on(self) -> None:
        """Begin to light the lamp."""
        with self._lock:
            self._line.begin()
            if self._power() in (PowerState.ON, PowerState.WARMING):
                return
            self._guard.may_light()
            # Noted before it is sent: a lost answer does not mean that the lamp stays dark.
            self._switch(PowerState.WARMING, self._dialect.ignition_s)
            self._guard.lit()
            self._light() if self._dialect.silent_start else self._command(Request(Verb.POWER_ON))

    def turn_off(self) -> None:
        """Begin to cool down."""
        with self._lock:
            self._line.begin()
            state = self._power()
            if state in (PowerState.STANDBY, PowerState.COOLING):
                return
            if state is PowerState.WARMING:
                raise DeviceRefusedError(
                    "The projector is still warming up. Wait until it is lit: a lamp that is "
                    "put out while it ignites is damaged."
                )
            self._guard.may_put_out()
            # Noted before it is sent, as the lighting is.
            self._switch(PowerState.COOLING, self._dialect.cooling_s)
            self._guard.put_out()
            try:
                self._command(Request(Verb.POWER_OFF))
            except DeviceRefusedError:
                self._guard.not_put_out()
                raise

    def select_source(self, code: str) -> None:
        """Show another input."""
        if not code.isalnum() or len(code) > 16 or not code.isascii():
            raise DeviceRefusedError(f"{code!r} is no input's code. Use letters and digits as in the manual.")
        with self._lock:
            self._line.begin()
            self._command(Request(Verb.SELECT_SOURCE, code))

    def mute(self, on: bool) -> None:
        """Make the picture black, or show it; verified by asking where that is possible."""
        self._set(Verb.MUTE if on else Verb.UNMUTE, Verb.ASK_MUTE, on)

    def freeze(self, on: bool) -> None:
        """Hold the picture, or let it go; verified by asking where that is possible."""
        self._set(Verb.FREEZE if on else Verb.UNFREEZE, Verb.ASK_FREEZE, on)

    def close(self) -> None:
        """Free the line."""
        with self._lock:
            self._line.close()

    def __enter__(self) -> "ProjectorLink":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _power(self) -> PowerState:
        if self._lighting and not self._lit():
            return PowerState.WARMING
        try:
            answer = self._line.ask(Request(Verb.ASK_POWER))
        except DeviceTimeoutError:
            return self._expected() or PowerState.SILENT
        if answer.kind is AnswerKind.BUSY:
            return self._expected() or PowerState.WARMING
        if answer.kind is AnswerKind.DENIED:
            raise DeviceRefusedError(f"The projector at {self._line.name} {_REASONS[answer.kind]}.")
        if not isinstance(answer.value, PowerState):
            raise DeviceRefusedError(
                f"The projector at {self._line.name} refuses to tell its power state. "
                "Check that the dialect is the right one for this model."
            )
        warming = self._expected() is PowerState.WARMING and not self._dialect.tells_warming
        if answer.value is PowerState.STANDBY and warming:
            return PowerState.WARMING  # "off" is all that it can say until it is lit
        self._note_seen(answer.value)
        if answer.value in (PowerState.ON, PowerState.STANDBY):
            self._switching = None
        return answer.value

    def _note_seen(self, power: PowerState) -> None:
        """Note what the lamp does that was not asked for from here."""
        lighting = self._expected() is PowerState.WARMING  # it may say "standby" until it has begun
        if power is PowerState.WARMING:
            self._guard.saw(burning=True)
        elif power is PowerState.COOLING or (power is PowerState.STANDBY and not lighting):
            self._guard.saw(burning=False)

    def _ask_all(self, capabilities: tuple[Capability, ...] | dict[Capability, Verb]) -> dict:
        found: dict[Capability, object] = {}
        for capability in capabilities:
            verb = _ASKED[capability]
            if self._unknown[verb] >= ABSENT_AFTER:
                continue
            try:
                answer = self._line.ask(Request(verb))
            except DeviceTimeoutError:
                return found
            if answer.kind is AnswerKind.VALUE:
                found[capability] = answer.value
            elif answer.kind is AnswerKind.ABSENT and capabilities is _ASKED:
                self._unknown[verb] += 1
        return found

    def _set(self, command: Verb, question: Verb, wanted: bool) -> None:
        with self._lock:
            self._line.begin()
            self._command(Request(command))
            answer = self._line.ask(Request(question))
            if answer.kind is AnswerKind.VALUE and answer.value is not wanted:
                raise DeviceRefusedError(
                    f"The projector took the command but says {question} {answer.value} instead of {wanted}. "
                    "Repeat it; some models drop it while the signal changes."
                )

    def _command(self, request: Request) -> None:
        switches = request.verb in (Verb.POWER_ON, Verb.POWER_OFF)
        if not switches and self._expected() is PowerState.WARMING and self._power() is PowerState.WARMING:
            raise DeviceRefusedError("The projector is still warming up. Wait until it is on, then repeat.")
        if self._line.in_doubt:
            self._line.ask(Request(Verb.ASK_POWER))  # replies come in order: late ones are past then
        answer = self._line.exchange(request) if switches else self._line.exchange_again(request)
        if answer.kind is AnswerKind.DONE:
            return
        if switches:
            self._switching = None
        reason = _REASONS[answer.kind]
        raise DeviceRefusedError(f"The projector at {self._line.name} {reason} ({request.verb}).")

    def _light(self) -> None:
        """Send the lighting; only a refusal comes soon."""
        request = Request(Verb.POWER_ON)
        self._line.send(request)
        answer = self._line.listen(request, QUIET_S)
        self._lighting = answer is None
        if answer is not None and answer.kind is not AnswerKind.DONE:
            self._switching = None
            raise DeviceRefusedError(
                f"The projector at {self._line.name} refuses to light its lamp. "
                "Let it cool down, and look at its indicators."
            )

    def _lit(self) -> bool:
        """Return whether the answer to the lighting has come, or its time is over."""
        try:
            answer = self._line.listen(Request(Verb.POWER_ON), 0.0)
        except DeviceNotFoundError:
            self._lighting = False
            return True
        if answer is None and self._expected() is PowerState.WARMING:
            return False
        self._lighting = False
        if answer is None:
            self._line.doubt()
        return True

    def _switch(self, state: PowerState, length_s: float) -> None:
        self._switching = state, self._clock.now_s() + length_s

    def _expected(self) -> PowerState | None:
        if self._switching is None or self._clock.now_s() >= self._switching[1]:
            return None
        return self._switching[0]


def _status(power: PowerState, found: dict[Capability, object], on_s: float | None) -> ProjectorStatus:
    return ProjectorStatus(
        power,
        source=_typed(found.get(Capability.SOURCE), str),
        muted=_typed(found.get(Capability.MUTE), bool),
        frozen=_typed(found.get(Capability.FREEZE), bool),
        lamp_hours=_typed(found.get(Capability.LAMP_HOURS), int),
        errors=_typed(found.get(Capability.ERRORS), tuple) or (),
        name=_typed(found.get(Capability.NAME), str),
        on_s=on_s,
    )


def _typed(value: object, kind: type[T]) -> T | None:
    return value if isinstance(value, kind) else None
