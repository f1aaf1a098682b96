"""The projector's side of PJLink, class 2, with or without a password."""

import hashlib

from drivers.projector.protocol import PowerState
from drivers.simulated.projector.responder import CrCommands, Reply
from drivers.simulated.projector.state import TwinState

_POWER = {PowerState.STANDBY: "0", PowerState.ON: "1", PowerState.COOLING: "2", PowerState.WARMING: "3"}


class PjLinkTwin(CrCommands):
    """Responds as a PJLink projector does; `salt` is the random number of the greeting (8 hex digits)."""

    error = b"%1POWR=ERR4\r"
    news = b"%2LKUP=00:11:22:33:44:55\r"
    idle_s = 30.0

    def __init__(self, state: TwinState, password: str = "", salt: str = "498e4a67") -> None:
        super().__init__(state)
        self._password, self._salt, self._trusted = password, salt, not password

    def greeting(self) -> bytes:
        """Say whether a password is wanted; each line must show it anew."""
        self._trusted = not self._password
        return b"PJLINK 0\r" if self._trusted else f"PJLINK 1 {self._salt}\r".encode()

    def respond(self, command: bytes) -> list[Reply]:
        """Return the reply to one command; the first must carry the digest."""
        text = command.decode("utf-8", "replace")
        if not self._trusted:
            digest = hashlib.md5((self._salt + self._password).encode(), usedforsecurity=False).hexdigest()
            if not text.lower().startswith(digest):
                return [Reply(b"PJLINK ERRA\r")]
            self._trusted, text = True, text[len(digest) :]
        head, _, value = text.partition(" ")
        answer = self._answer(head.upper(), value)
        return [Reply(f"{head}={answer}\r".encode())]

    def _answer(self, head: str, value: str) -> str:
        state = self.state
        on = state.power is PowerState.ON
        if value == "?":
            return self._value(head, on)
        if head == "%1POWR":
            done = {"1": state.turn_on, "0": state.turn_off}.get(value)
            return "ERR2" if done is None else ("OK" if done() else "ERR3")
        if head not in ("%1INPT", "%1AVMT", "%2FREZ"):
            return "ERR1"
        if not on:
            return "ERR3"
        if head == "%1INPT":
            return "OK" if state.select(value) else "ERR2"
        if value[-1:] not in ("0", "1"):
            return "ERR2"
        setattr(state, "muted" if head == "%1AVMT" else "frozen", value[-1] == "1")
        return "OK"

    def _value(self, head: str, on: bool) -> str:
        state = self.state
        always = {
            "%1POWR": _POWER[state.power],
            "%1LAMP": f"{state.lamp_hours} {int(on)}",
            "%1ERST": "000000" if not state.errors else "200000",
            "%1NAME": state.name,
            "%1INF1": "TWIN",
            "%1INF2": state.name,
            "%1INFO": "",
            "%1CLSS": "2",
            "%1INST": " ".join(state.sources),
            "%2SNUM": "0001",
            "%2SVER": "1.0",
        }
        lit = {
            "%1INPT": state.source,
            "%1AVMT": "31" if state.muted else "30",
            "%2FREZ": str(int(state.frozen)),
            "%2IRES": "1920x1080",
            "%2RRES": "1920x1080",
        }
        if head in always:
            return always[head]
        return (lit[head] if on else "ERR3") if head in lit else "ERR1"
