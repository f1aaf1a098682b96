"""Never cycle a lamp faster than its manual allows, not even from two programs one after the other."""

import contextlib
import json
import time
from collections.abc import Callable
from pathlib import Path

from drivers.errors import DeviceRefusedError


class LampGuard:
    """Remembers when the lamp was lit and put out; with `journal`, across runs of the program.

    A lamp that is put out before it is hot, or lit before it is cold, ages by many hours: most manuals ask
    for minutes. `now_s` is wall-clock time.
    """

    def __init__(
        self,
        min_on_s: float = 120.0,
        min_off_s: float = 120.0,
        journal: Path | None = None,
        now_s: Callable[[], float] = time.time,
    ) -> None:
        self._min_on_s, self._min_off_s = min_on_s, min_off_s
        self._journal, self._now_s = journal, now_s
        self._times: dict[str, float] = {}
        self._before: dict[str, float] = {}
        self._read()

    @property
    def on_s(self) -> float | None:
        """How long the lamp has been on; None when unknown or off."""
        self._read()
        lit = self._times.get("on")
        if lit is None or lit < self._times.get("off", float("-inf")):
            return None
        return max(0.0, self._now_s() - lit)

    def may_light(self) -> None:
        """Return when the lamp may be lit. Raises DeviceRefusedError that says how long to wait."""
        self._check("off", self._min_off_s, "The lamp went out only just now")

    def may_put_out(self) -> None:
        """Return when the lamp may be put out. Raises DeviceRefusedError that says how long to wait."""
        self._check("on", self._min_on_s, "The lamp was lit only just now")

    def lit(self) -> None:
        """Note that the lamp was lit."""
        self._note("on")

    def put_out(self) -> None:
        """Note that the lamp was put out."""
        self._note("off")

    def not_put_out(self) -> None:
        """Take the note of `put_out` back: the projector refused."""
        self._write(self._before)

    def saw(self, *, burning: bool) -> None:
        """Note what somebody else did with the lamp, as done now: by remote control, or at the projector."""
        if burning and self.on_s is None:
            self.lit()
        if not burning and self.on_s is not None:
            self.put_out()

    def _check(self, key: str, least_s: float, what: str) -> None:
        self._read()
        since_s = self._now_s() - self._times.get(key, float("-inf"))
        if 0 <= since_s < least_s:
            raise DeviceRefusedError(
                f"{what} ({since_s:.0f} s ago); at least {least_s:.0f} s must pass. "
                f"Wait {least_s - since_s:.0f} s: cycling faster ruins the lamp."
            )

    def _note(self, key: str) -> None:
        self._read()
        self._before = dict(self._times)
        self._write(self._times | {key: self._now_s()})

    def _read(self) -> None:
        """Take over what other programs have noted since."""
        if self._journal is None or not self._journal.exists():
            return
        with contextlib.suppress(ValueError, OSError):
            read = json.loads(self._journal.read_text(encoding="utf-8"))
            self._times = {key: float(read[key]) for key in ("on", "off") if key in read}

    def _write(self, times: dict[str, float]) -> None:
        self._times = times
        if self._journal is not None:
            self._journal.parent.mkdir(parents=True, exist_ok=True)
            temporary = self._journal.with_suffix(".tmp")
            temporary.write_text(json.dumps(self._times), encoding="utf-8")
            temporary.replace(self._journal)
