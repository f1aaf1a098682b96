"""The Optoma side: P or F, one line of information, and INFO lines that nobody asked for."""

import re

from drivers.projector.protocol import PowerState
from drivers.simulated.projector.responder import CrCommands, Reply


class OptomaTwin(CrCommands):
    """Responds as an Optoma does."""

    error = b"F\r"
    news = b"INFO0\r"

    def respond(self, command: bytes) -> list[Reply]:
        """Return P, F or the information line; a switch announces itself."""
        match = re.fullmatch(rb"~(\d\d)(\d\d|\d{3}) (\d+)", command.strip())
        if match is None:
            return [Reply(b"F\r")]
        number, value = match[2].decode(), match[3].decode()
        state = self.state
        if number == "150":
            return [Reply(self._information())]
        if number == "00":
            done = state.turn_on() if value == "1" else state.turn_off()
            news = b"INFO1\r" if value == "1" else b"INFO2\r"
            return [Reply(b"P\r"), Reply(news)] if done else [Reply(b"F\r")]
        if state.power is not PowerState.ON:
            return [Reply(b"F\r")]
        if number == "12":
            return [Reply(b"P\r" if state.select(value) else b"F\r")]
        if number in ("02", "04") and value in ("0", "1"):
            setattr(state, "muted" if number == "02" else "frozen", value == "1")
            return [Reply(b"P\r")]
        return [Reply(b"F\r")]

    def _information(self) -> bytes:
        state = self.state
        on = int(state.power is PowerState.ON)
        return f"OK{on}{state.lamp_hours:04d}{state.source:0>2}C0110\r".encode("ascii")
