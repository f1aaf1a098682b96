"""PJLink class 1 and 2, over TCP 4352: `%1POWR ?` CR -> `%1POWR=1` CR, errors ERR1 to ERR4 and ERRA.

Source: PJLink specification 1.04 and 2.00. The password never travels: the first command carries the MD5 of
the projector's random number and the password.
"""

import hashlib
import re

from drivers.projector.dialect import (
    ABSENT,
    BUSY,
    DENIED,
    DONE,
    FAILED,
    OTHER,
    Answer,
    AnswerKind,
    Request,
    Verb,
)
from drivers.projector.protocol import Capability, PowerState

_COMMANDS = {
    Verb.HELLO: "%1CLSS ?",
    Verb.POWER_ON: "%1POWR 1",
    Verb.POWER_OFF: "%1POWR 0",
    Verb.MUTE: "%1AVMT 11",
    Verb.UNMUTE: "%1AVMT 10",
    Verb.FREEZE: "%2FREZ 1",
    Verb.UNFREEZE: "%2FREZ 0",
    Verb.ASK_POWER: "%1POWR ?",
    Verb.ASK_SOURCE: "%1INPT ?",
    Verb.ASK_MUTE: "%1AVMT ?",
    Verb.ASK_FREEZE: "%2FREZ ?",
    Verb.ASK_HOURS: "%1LAMP ?",
    Verb.ASK_ERRORS: "%1ERST ?",
    Verb.ASK_NAME: "%1NAME ?",
}
_POWER = {"0": PowerState.STANDBY, "1": PowerState.ON, "2": PowerState.COOLING, "3": PowerState.WARMING}
_PARTS = ("fan", "lamp", "temperature", "cover", "filter", "other")
_REFUSALS = {"ERR1": ABSENT, "ERR2": ABSENT, "ERR3": BUSY, "ERR4": FAILED}


class PjLink:
    """The PJLink dialect."""

    name = "pjlink"
    hdmi = "31"
    timeout_s = 4.0  # the specification grants 2 s
    ignition_s = 180.0
    cooling_s = 180.0
    silent_start = False
    tells_warming = True
    capabilities = frozenset(Capability)

    def encode(self, request: Request) -> bytes | None:
        """Return one command, ended by CR; freeze is of class 2."""
        text = _COMMANDS.get(request.verb) or f"%1INPT {request.argument}"
        return text.encode("ascii") + b"\r"

    def split(self, buffer: bytes, *, idle: bool) -> tuple[list[bytes], bytes]:
        """Every message ends with CR."""
        *messages, rest = buffer.split(b"\r")
        return messages, rest

    def decode(self, request: Request, message: bytes) -> Answer:
        """Return the meaning of one line; only the answer to this very command counts."""
        text = message.decode("utf-8", "replace").strip()
        if text.upper() == "PJLINK ERRA":
            return DENIED
        head, equals, value = text.partition("=")
        asked = (self.encode(request) or b"").decode()[:6]
        if not equals or head.upper() != asked:
            return OTHER
        if value in _REFUSALS:
            return _REFUSALS[value]
        if value == "OK":
            return DONE
        return _value(request.verb, value)


def greeting_digest(greeting: bytes, password: str) -> bytes | None:
    """Return what to put before the first command: empty without a password, None for no greeting.

    Raises ValueError when the projector wants a password and none is given.
    """
    match = re.fullmatch(rb"PJLINK (0|1 ([0-9A-Fa-f]{8}))\s*", greeting)
    if match is None:
        return None
    if match[2] is None:
        return b""
    if not password:
        raise ValueError(
            "The projector wants a password and none is given. Set AIRLENS_PROJECTOR_PASSWORD to it."
        )
    # The protocol prescribes MD5; it protects no secret of ours.
    digest = hashlib.md5(match[2] + password.encode("utf-8"), usedforsecurity=False)
    return digest.hexdigest().encode("ascii")


def _value(verb: Verb, text: str) -> Answer:
    if verb is Verb.HELLO:
        return DONE
    if verb is Verb.ASK_POWER:
        state = _POWER.get(text)
        return Answer(AnswerKind.VALUE, state, state) if state else OTHER
    if verb is Verb.ASK_MUTE:
        known = re.fullmatch("[123][01]", text)
        return Answer(AnswerKind.VALUE, text in ("11", "31")) if known else OTHER
    if verb is Verb.ASK_FREEZE:
        return Answer(AnswerKind.VALUE, text == "1") if text in ("0", "1") else OTHER
    if verb is Verb.ASK_HOURS:
        hours = text.split(" ")[0]
        return Answer(AnswerKind.VALUE, int(hours)) if hours.isdigit() else OTHER
    if verb is Verb.ASK_ERRORS:
        if not re.fullmatch("[012]{6}", text):
            return OTHER
        words = {"1": "warning", "2": "error"}
        found = (f"{part}: {words[c]}" for part, c in zip(_PARTS, text, strict=True) if c in words)
        return Answer(AnswerKind.VALUE, tuple(found))
    return Answer(AnswerKind.VALUE, text)
