"""The BenQ side: echo, answer in upper case, prompt; everything is blocked while it warms or cools."""

import re

from drivers.projector.protocol import PowerState
from drivers.simulated.projector.responder import CrCommands, Reply

_COMMAND = re.compile(r"\*([a-z0-9]+)=([^#]*)#")


class BenQTwin(CrCommands):
    """Responds as a BenQ with a prompt does."""

    error = b"Illegal format\r\n>"
    news = b"\r\n*VOL=5#\r\n>"

    def respond(self, command: bytes) -> list[Reply]:
        """Return echo, answer and prompt; an empty line gets the prompt alone."""
        text = command.decode("ascii", "replace").strip()
        if not text:
            return [Reply(b">")]
        match = _COMMAND.fullmatch(text.lower())
        answer = self._answer(match[1], match[2]) if match else "Illegal format"
        return [Reply(f"{text}\r\n{answer}\r\n>".encode("ascii", "replace"))]

    def _answer(self, item: str, value: str) -> str:
        state, power = self.state, self.state.power
        if power in (PowerState.WARMING, PowerState.COOLING):
            return "*Block item#"
        on = power is PowerState.ON
        if value == "?":
            return self._value(item, on)
        if item == "pow" and value in ("on", "off"):
            done = state.turn_on() if value == "on" else state.turn_off()
            return f"*POW={value.upper()}#" if done else "*Block item#"
        if not on:
            return "*Block item#"
        if item == "sour":
            return f"*SOUR={value.upper()}#" if state.select(value) else "Unsupported item"
        if item in ("blank", "freeze") and value in ("on", "off"):
            setattr(state, {"blank": "muted", "freeze": "frozen"}[item], value == "on")
            return f"*{item.upper()}={value.upper()}#"
        return "Unsupported item"

    def _value(self, item: str, on: bool) -> str:
        state = self.state
        always = {"pow": "ON" if on else "OFF", "modelname": state.name, "ltim": str(state.lamp_hours)}
        lit = {
            "sour": state.source.upper(),
            "blank": "ON" if state.muted else "OFF",
            "freeze": "ON" if state.frozen else "OFF",
        }
        if item in always:
            return f"*{item.upper()}={always[item]}#"
        if item in lit:
            return f"*{item.upper()}={lit[item]}#" if on else "*Block item#"
        return "Unsupported item"
