"""BenQ: CR `*pow=?#` CR -> an echo, `*POW=ON#`, a prompt `>`; `Block item` while it warms or cools.

Source: command lists of HT3550, LW500, SP920. Two traps: it is silent for 60 to 90 s while it starts, and
one that is flooded with CR for its prompt never comes back. So one CR leads each command, and no more.
"""

import re

from drivers.projector.dialect import ABSENT, BUSY, OTHER, Answer, AnswerKind, Request, Verb
from drivers.projector.protocol import Capability, PowerState

_ITEMS = {
    Verb.POWER_ON: ("pow", "on"),
    Verb.POWER_OFF: ("pow", "off"),
    Verb.MUTE: ("blank", "on"),
    Verb.UNMUTE: ("blank", "off"),
    Verb.FREEZE: ("freeze", "on"),
    Verb.UNFREEZE: ("freeze", "off"),
    Verb.HELLO: ("pow", "?"),
    Verb.ASK_POWER: ("pow", "?"),
    Verb.ASK_SOURCE: ("sour", "?"),
    Verb.ASK_MUTE: ("blank", "?"),
    Verb.ASK_FREEZE: ("freeze", "?"),
    Verb.ASK_HOURS: ("ltim", "?"),
    Verb.ASK_NAME: ("modelname", "?"),
}
_MESSAGE = re.compile(rb"\*[^#\r\n*]*#|\*?(?:Illegal format|Unsupported item|Block item)#?", re.IGNORECASE)


class BenQ:
    """The BenQ dialect."""

    name = "benq"
    hdmi = "hdmi"
    timeout_s = 3.0
    ignition_s = 120.0
    cooling_s = 120.0
    silent_start = False
    tells_warming = False
    capabilities = frozenset(Capability) - {Capability.ERRORS}

    def encode(self, request: Request) -> bytes | None:
        """Return one command between CRs; None for the errors, which it cannot be asked."""
        if request.verb is Verb.ASK_ERRORS:
            return None
        item, value = _ITEMS.get(request.verb, ("sour", request.argument))
        return f"\r*{item}={value}#\r".encode("ascii")

    def split(self, buffer: bytes, *, idle: bool) -> tuple[list[bytes], bytes]:
        """Messages are `*item=value#` and the three refusals; prompts and line ends are dropped."""
        matches = list(_MESSAGE.finditer(buffer))
        rest = buffer[matches[-1].end() :] if matches else buffer
        return [match[0] for match in matches], rest[-200:]

    def decode(self, request: Request, message: bytes) -> Answer:
        """Return the meaning of one message; the echo is in lower case, the answer in upper case."""
        text = message.decode("ascii", "replace").strip("*#")
        lower = text.lower()
        if lower in ("illegal format", "unsupported item"):
            return ABSENT
        if lower == "block item":
            return BUSY
        item, _, value = text.partition("=")
        wanted, sent = _ITEMS.get(request.verb, ("sour", request.argument))
        if item.lower() != wanted or value == "?" or text == f"{wanted}={sent}":
            return OTHER
        if not request.verb.asks:
            power = _power(value) if wanted == "pow" else None
            return Answer(AnswerKind.DONE, None, power)
        return _value(request.verb, value)


def _power(value: str) -> PowerState | None:
    return {"on": PowerState.ON, "off": PowerState.STANDBY}.get(value.lower())


def _value(verb: Verb, value: str) -> Answer:
    if verb is Verb.ASK_POWER:
        state = _power(value)
        return Answer(AnswerKind.VALUE, state, state) if state else OTHER
    if verb in (Verb.ASK_MUTE, Verb.ASK_FREEZE):
        known = value.lower() in ("on", "off")
        return Answer(AnswerKind.VALUE, value.lower() == "on") if known else OTHER
    if verb is Verb.ASK_HOURS:
        return Answer(AnswerKind.VALUE, int(value)) if value.isdigit() else OTHER
    return Answer(AnswerKind.VALUE, value)
