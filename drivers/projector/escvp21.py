"""Epson ESC/VP21: `PWR?` CR -> `PWR=01` CR `:`; a set is answered by `:` alone, an unknown command by `ERR`.

Source: User's Guide command lists (EB-L735U p. 36, EMP-54 p. 97); openHAB's epsonprojector for the times.
`PWR ON` is answered only when the lamp is lit (up to 100 s), and nothing else is meanwhile.
"""

from drivers.projector.dialect import ABSENT, DONE, OTHER, Answer, AnswerKind, Request, Verb
from drivers.projector.protocol import Capability, PowerState

_SETS = {
    Verb.HELLO: "",
    Verb.POWER_ON: "PWR ON",
    Verb.POWER_OFF: "PWR OFF",
    Verb.MUTE: "MUTE ON",
    Verb.UNMUTE: "MUTE OFF",
    Verb.FREEZE: "FREEZE ON",
    Verb.UNFREEZE: "FREEZE OFF",
}
_ASKS = {
    Verb.ASK_POWER: "PWR",
    Verb.ASK_SOURCE: "SOURCE",
    Verb.ASK_MUTE: "MUTE",
    Verb.ASK_FREEZE: "FREEZE",
    Verb.ASK_HOURS: "LAMP",
    Verb.ASK_ERRORS: "ERR",
    Verb.ASK_NAME: "SNO",
}
_POWER = {
    "00": PowerState.STANDBY,
    "01": PowerState.ON,
    "02": PowerState.WARMING,
    "03": PowerState.COOLING,
    "04": PowerState.STANDBY,
    "05": PowerState.FAULT,
    "09": PowerState.STANDBY,
}
_ERRORS = {
    "01": "fan",
    "03": "lamp did not light",
    "04": "too hot",
    "06": "lamp",
    "07": "lamp cover open",
    "08": "filter",
    "0A": "auto iris",
    "0C": "low air flow",
    "0D": "air flow sensor",
    "0E": "ballast",
    "0F": "shutter",
    "18": "internal bus",
}


class EscVp21:
    """The Epson dialect."""

    name = "escvp21"
    hdmi = "30"
    timeout_s = 5.0
    ignition_s = 110.0
    cooling_s = 130.0
    silent_start = True
    tells_warming = True
    capabilities = frozenset(Capability)

    def encode(self, request: Request) -> bytes | None:
        """Return one command, ended by CR."""
        if request.verb in _SETS:
            text = _SETS[request.verb]
        elif request.verb in _ASKS:
            text = _ASKS[request.verb] + "?"
        else:
            text = f"SOURCE {request.argument}"
        return text.encode("ascii") + b"\r"

    def split(self, buffer: bytes, *, idle: bool) -> tuple[list[bytes], bytes]:
        """Every message ends with a colon."""
        *messages, rest = buffer.split(b":")
        return messages, rest

    def decode(self, request: Request, message: bytes) -> Answer:
        """Return the meaning of the text before a colon; the last line counts, others are news."""
        lines = [line for line in message.decode("ascii", "replace").split("\r") if line]
        last = lines[-1] if lines else ""
        if last == "ERR":
            return ABSENT
        if request.verb in _ASKS:
            name, equals, value = last.partition("=")
            return _value(request.verb, value) if equals and name == _ASKS[request.verb] else OTHER
        return OTHER if last else DONE


def _value(verb: Verb, text: str) -> Answer:
    if verb is Verb.ASK_POWER:
        state = _POWER.get(text)
        return Answer(AnswerKind.VALUE, state, state) if state else OTHER
    if verb is Verb.ASK_HOURS:
        return Answer(AnswerKind.VALUE, int(text)) if text.isdigit() else OTHER
    if verb in (Verb.ASK_MUTE, Verb.ASK_FREEZE):
        return Answer(AnswerKind.VALUE, text == "ON") if text in ("ON", "OFF") else OTHER
    if verb is Verb.ASK_ERRORS:
        errors = () if text == "00" else (_ERRORS.get(text, f"code {text}"),)
        return Answer(AnswerKind.VALUE, errors)
    return Answer(AnswerKind.VALUE, text)
