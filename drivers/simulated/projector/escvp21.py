"""The Epson side of ESC/VP21. A lamp that is being lit answers nothing until it is lit."""

from drivers.projector.protocol import PowerState
from drivers.simulated.projector.responder import CrCommands, Reply

_POWER = {PowerState.STANDBY: "00", PowerState.ON: "01", PowerState.WARMING: "02", PowerState.COOLING: "03"}


class EscVp21Twin(CrCommands):
    """Responds as an Epson does."""

    error = b"ERR\r:"
    news = b"IMEVENT=0001 03 00000002 00000000 T1 F1\r:"

    def respond(self, command: bytes) -> list[Reply]:
        """Return the reply to one command."""
        text = command.decode("ascii", "replace").strip()
        power = self.state.power
        if power is PowerState.WARMING:
            return []
        if text == "":
            return [Reply(b":")]
        if text == "PWR ON":
            return [Reply(b":", self.state.ready_in_s)] if self.state.turn_on() else [Reply(self.error)]
        answer = self._answer(text, power)
        return [Reply(self.error)] if answer is None else [Reply(answer.encode("ascii") + b":")]

    def _answer(self, text: str, power: PowerState) -> str | None:
        state, on = self.state, power is PowerState.ON
        values = {"PWR?": _POWER[power], "LAMP?": str(state.lamp_hours), "SNO?": state.name}
        values["ERR?"] = "00" if not state.errors else "01"
        if on:
            values |= {"SOURCE?": state.source, "MUTE?": _on(state.muted), "FREEZE?": _on(state.frozen)}
        if text in values:
            return f"{text[:-1]}={values[text]}\r"
        name, _, value = text.partition(" ")
        if text == "PWR OFF":
            return "" if state.turn_off() else None
        if not on:
            return None
        if name == "SOURCE":
            return "" if state.select(value) else None
        if name in ("MUTE", "FREEZE") and value in ("ON", "OFF"):
            setattr(state, {"MUTE": "muted", "FREEZE": "frozen"}[name], value == "ON")
            return ""
        return None


def _on(value: bool) -> str:
    return "ON" if value else "OFF"
