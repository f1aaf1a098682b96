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
        if journal is not None and journal.exists():
            with contextlib.suppress(ValueError, OSError):
                read = json.loads(journal.read_text(encoding="utf-8"))
                self._times = {key: float(read[key]) for key in ("on", "off") if key in read}

    @property
    def on_s(self) -> float | None:
        """How long the lamp has been on; None when unknown or off."""
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

    def _check(self, key: str, least_s: float, what: str) -> None:
        since_s = self._now_s() - self._times.get(key, float("-inf"))
        if 0 <= since_s < least_s:
            raise DeviceRefusedError(
                f"{what} ({since_s:.0f} s ago); at least {least_s:.0f} s must pass. "
                f"Wait {least_s - since_s:.0f} s: cycling faster ruins the lamp."
            )

    def _note(self, key: str) -> None:
        self._times[key] = self._now_s()
        if self._journal is not None:
            self._journal.parent.mkdir(parents=True, exist_ok=True)
            temporary = self._journal.with_suffix(".tmp")
            temporary.write_text(json.dumps(self._times), encoding="utf-8")
            temporary.replace(self._journal)
