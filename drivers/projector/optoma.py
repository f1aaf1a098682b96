"""Optoma: `~0000 1` CR -> `P` or `F`; `~00150 1` -> `OK` with power, lamp hours, source, firmware, mode.

Source: RS-232 tables of HD50, HD66, PRO150S, HD75. Field widths differ by model: only those are read whose
place is certain. `INFO0` to `INFO3` come unasked.
"""

import re

from drivers.projector.dialect import DONE, FAILED, OTHER, Answer, AnswerKind, Request, Verb
from drivers.projector.protocol import Capability, PowerState

_SETS = {
    Verb.POWER_ON: "~0000 1",
    Verb.POWER_OFF: "~0000 0",
    Verb.MUTE: "~0002 1",
    Verb.UNMUTE: "~0002 0",
    Verb.FREEZE: "~0004 1",
    Verb.UNFREEZE: "~0004 0",
}
_ASKS = (Verb.HELLO, Verb.ASK_POWER, Verb.ASK_SOURCE, Verb.ASK_HOURS)
_NEWS = {b"INFO0": PowerState.STANDBY, b"INFO1": PowerState.WARMING, b"INFO2": PowerState.COOLING}
_MESSAGE = re.compile(rb"(?<![^\r\n])(?:OK[0-9A-Za-z]*|INFO\d|P|F)(?=[\r\n])")
_LAST = re.compile(rb"(?<![^\r\n])(?:OK[0-9A-Za-z]*|INFO\d|P|F)(?=[\r\n]|$)")
_INFO = re.compile(r"OK([01])(\d{4,5})(\d{2})\w{4}\d")


class Optoma:
    """The Optoma dialect."""

    name = "optoma"
    hdmi = "1"
    timeout_s = 3.0
    ignition_s = 90.0
    cooling_s = 120.0
    silent_start = False
    tells_warming = False
    capabilities = frozenset(Capability) - {Capability.ERRORS, Capability.NAME}

    def encode(self, request: Request) -> bytes | None:
        """Return one command, ended by CR; None for what there is no question for."""
        if request.verb in _SETS:
            text = _SETS[request.verb]
        elif request.verb in _ASKS:
            text = "~00150 1"
        elif request.verb is Verb.SELECT_SOURCE:
            text = f"~0012 {request.argument}"
        else:
            return None
        return text.encode("ascii") + b"\r"

    def split(self, buffer: bytes, *, idle: bool) -> tuple[list[bytes], bytes]:
        """Messages end with CR; some models leave it out, then silence ends them."""
        pattern = _LAST if idle else _MESSAGE
        matches = list(pattern.finditer(buffer))
        rest = buffer[matches[-1].end() :] if matches else buffer
        return [match[0] for match in matches], rest[-200:]

    def decode(self, request: Request, message: bytes) -> Answer:
        """Return the meaning of one message."""
        if message in _NEWS:
            return Answer(AnswerKind.OTHER, None, _NEWS[message])
        if request.verb in _ASKS:
            if message == b"F":
                return FAILED
            return _value(request.verb, message.decode("ascii", "replace"))
        return {b"P": DONE, b"F": FAILED}.get(message, OTHER)


def _value(verb: Verb, text: str) -> Answer:
    match = _INFO.fullmatch(text)
    power = re.match("OK([01])", text)
    if not power:
        return OTHER
    state = PowerState.ON if power[1] == "1" else PowerState.STANDBY
    if verb is Verb.HELLO:
        return Answer(AnswerKind.DONE, None, state)
    if verb is Verb.ASK_POWER:
        return Answer(AnswerKind.VALUE, state, state)
    if match is None:
        return Answer(AnswerKind.ABSENT)
    return Answer(AnswerKind.VALUE, int(match[2]) if verb is Verb.ASK_HOURS else match[3])
