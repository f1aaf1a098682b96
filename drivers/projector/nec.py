"""NEC: binary frames with a checksum: `02 00 00 00 00 02` lights the lamp, `22 00 id1 id2 00 ck` says done.

Source: command tables of NP-UM361X (pp. 10-12), ME382U (p. 19), PX2000UL (p. 64), V260X (p. 35). The basic
information request, freeze, lamp and error requests follow NEC's command reference; not met on hardware yet.
Nothing is accepted while it turns on or off; a picture mute clears itself when the input changes.
"""

from drivers.projector.dialect import ABSENT, BUSY, DONE, FAILED, OTHER, Answer, AnswerKind, Request, Verb
from drivers.projector.protocol import Capability, PowerState

_BASIC = bytes.fromhex("00BF00000102")
_COMMANDS = {
    Verb.HELLO: _BASIC,
    Verb.POWER_ON: bytes.fromhex("0200000000"),
    Verb.POWER_OFF: bytes.fromhex("0201000000"),
    Verb.MUTE: bytes.fromhex("0210000000"),
    Verb.UNMUTE: bytes.fromhex("0211000000"),
    Verb.FREEZE: bytes.fromhex("019800000101"),
    Verb.UNFREEZE: bytes.fromhex("019800000102"),
    Verb.ASK_POWER: _BASIC,
    Verb.ASK_SOURCE: _BASIC,
    Verb.ASK_MUTE: bytes.fromhex("008500000103"),
    Verb.ASK_FREEZE: _BASIC,
    Verb.ASK_HOURS: bytes.fromhex("03960000020001"),
    Verb.ASK_ERRORS: bytes.fromhex("0088000000"),
}
_POWER = {
    0x00: PowerState.STANDBY,
    0x04: PowerState.ON,
    0x05: PowerState.COOLING,
    0x06: PowerState.FAULT,
    0x0F: PowerState.STANDBY,
    0x10: PowerState.STANDBY,
}
_ERROR_BITS = ("cover", "temperature", "fan", "fan", "power", "lamp", "lamp replace soon", "lamp moulded")


def with_checksum(body: bytes) -> bytes:
    """Return the body with the low byte of its sum."""
    return body + bytes([sum(body) & 0xFF])


class Nec:
    """The NEC dialect."""

    name = "nec"
    hdmi = "1A"
    timeout_s = 3.0
    ignition_s = 120.0
    cooling_s = 180.0
    silent_start = False
    tells_warming = False
    capabilities = frozenset(Capability) - {Capability.NAME}

    def encode(self, request: Request) -> bytes | None:
        """Return one frame; None for the name, which no short request asks."""
        if request.verb is Verb.ASK_NAME:
            return None
        body = _COMMANDS.get(request.verb)
        if body is None:
            body = bytes.fromhex("020300000201") + bytes.fromhex(request.argument)
        return with_checksum(body)

    def split(self, buffer: bytes, *, idle: bool) -> tuple[list[bytes], bytes]:
        """Frames are head (5 bytes, the last the length), data, checksum; noise before one is skipped."""
        messages = []
        while len(buffer) >= 6:
            size = 6 + buffer[4]
            good = buffer[0] >> 4 in (0x2, 0xA)
            if good and len(buffer) < size:
                break
            if good and with_checksum(buffer[: size - 1]) == buffer[:size]:
                messages.append(buffer[:size])
                buffer = buffer[size:]
            else:
                buffer = buffer[1:]
        return messages, b"" if idle else buffer

    def decode(self, request: Request, message: bytes) -> Answer:
        """Return the meaning of one frame; only the answer to this very command counts."""
        body = self.encode(request) or b"\0\0"
        if message[1] != body[1] or message[0] & 0x0F != body[0]:
            return OTHER
        if message[0] >> 4 == 0xA:
            return _refusal(message[5:7])
        return _value(request.verb, message[5:-1]) if request.verb.asks else DONE


def _refusal(error: bytes) -> Answer:
    if error[:1] in (b"\x00", b"\x01"):
        return ABSENT
    return BUSY if error in (b"\x02\x0d", b"\x02\x03", b"\x02\x04") else FAILED


def _value(verb: Verb, data: bytes) -> Answer:
    if verb is Verb.ASK_MUTE:
        return Answer(AnswerKind.VALUE, data[0] == 1) if data else OTHER
    if verb is Verb.ASK_HOURS:
        seconds = int.from_bytes(data[2:6], "little")
        return Answer(AnswerKind.VALUE, seconds // 3600) if len(data) >= 6 else OTHER
    if verb is Verb.ASK_ERRORS:
        found = {_ERROR_BITS[bit] for bit in range(8) if data[:1] and data[0] >> bit & 1}
        return Answer(AnswerKind.VALUE, tuple(sorted(found)))
    if len(data) < 10:
        return OTHER
    # Data: 02, operation status, content, signal type (2 bytes), display type, three mutes, freeze.
    if verb is Verb.ASK_POWER:
        state = _POWER.get(data[1], PowerState.FAULT)
        return Answer(AnswerKind.VALUE, state, state)
    if verb is Verb.ASK_FREEZE:
        return Answer(AnswerKind.VALUE, data[9] == 1)
    return Answer(AnswerKind.VALUE, f"{data[3]:02X}-{data[4]:02X}")
