"""The NEC side: binary frames; nothing is accepted while it turns on or off, a mute ends with the input."""

from drivers.projector.nec import with_checksum
from drivers.projector.protocol import PowerState
from drivers.simulated.projector.responder import Reply
from drivers.simulated.projector.state import TwinState

_IDS = b"\x01\x20"
_POWER = {PowerState.STANDBY: 0x00, PowerState.ON: 0x04, PowerState.WARMING: 0x04, PowerState.COOLING: 0x05}


class NecTwin:
    """Responds as an NEC does."""

    error = with_checksum(b"\xa2\x00" + _IDS + b"\x02\x02\x0f")
    news = with_checksum(b"\x20\x99" + _IDS + b"\x01\x00")
    idle_s: float | None = None

    def __init__(self, state: TwinState) -> None:
        self.state = state

    def greeting(self) -> bytes:
        """Nothing."""
        return b""

    def split(self, buffer: bytes) -> tuple[list[bytes], bytes]:
        """Frames by their length byte; a wrong checksum loses one byte at a time."""
        commands = []
        while len(buffer) >= 6 and len(buffer) >= 6 + buffer[4]:
            size = 6 + buffer[4]
            if with_checksum(buffer[: size - 1]) == buffer[:size]:
                commands.append(buffer[:size])
                buffer = buffer[size:]
            else:
                buffer = buffer[1:]
        return commands, buffer

    def respond(self, command: bytes) -> list[Reply]:
        """Return the reply frame."""
        kind, data = (command[0], command[1]), command[5:-1]
        done = self._set(kind, data)
        if done is not None:
            return [_frame(0x20, kind, b"") if done else _frame(0xA0, kind, b"\x02\x0d")]
        value = self._value(kind)
        return [_frame(0xA0, kind, b"\x00\x00") if value is None else _frame(0x20, kind, value)]

    def _set(self, kind: tuple[int, int], data: bytes) -> bool | None:
        state = self.state
        if kind == (2, 0):
            return state.turn_on()
        if kind == (2, 1):
            return state.turn_off()
        if kind not in ((2, 3), (2, 0x10), (2, 0x11), (1, 0x98)):
            return None
        if state.power is not PowerState.ON:
            return False
        if kind == (2, 3):
            state.muted = False
            return state.select(data[1:].hex().upper())
        if kind[0] == 2:
            state.muted = kind[1] == 0x10
        else:
            state.frozen = data == b"\x01"
        return True

    def _value(self, kind: tuple[int, int]) -> bytes | None:
        state = self.state
        if kind == (0, 0xBF):
            source = bytes([1, 0x21]) if state.source == "1A" else bytes([1, 1])
            flags = bytes([state.muted, 0, 0, state.frozen])
            return bytes([2, _POWER[state.power], 0]) + source + b"\x21" + flags + bytes(6)
        if kind == (0, 0x85):
            return bytes([state.muted]) + bytes(15)
        if kind == (3, 0x96):
            return b"\x00\x01" + (state.lamp_hours * 3600).to_bytes(4, "little")
        if kind == (0, 0x88):
            return bytes([4 if state.errors else 0]) + bytes(11)
        return None


def _frame(high: int, kind: tuple[int, int], data: bytes) -> Reply:
    return Reply(with_checksum(bytes([high | kind[0], kind[1]]) + _IDS + bytes([len(data)]) + data))
