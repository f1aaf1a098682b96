"""What a worker tells, line by line, as events that the ledger can hold: any number, any text, any damage."""

import json
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PAGE_BYTES = 1 << 20
# The largest whole number of a column of SQLite.
MOST = (1 << 63) - 1
_SHOWN = 200


@dataclass(frozen=True)
class Told:
    """One line of events.jsonl. `step` and `steps` are 0 unless the line tells progress."""

    kind: str
    body: Mapping[str, Any]
    at_s: float
    step: int = 0
    steps: int = 0


def whole_lines(path: Path, start: int) -> tuple[list[bytes], int]:
    """Return the whole lines from byte `start` and where they end; a line longer than a page is cut."""
    try:
        with open(path, "rb") as file:
            file.seek(start)
            content = file.read(PAGE_BYTES)
    except FileNotFoundError:
        return [], start
    whole = content[: content.rfind(b"\n") + 1]
    if not whole and len(content) == PAGE_BYTES:
        whole = content
    return whole.splitlines(), start + len(whole)


def told(line: bytes) -> Told:
    """Return what a line tells; one that cannot be read becomes an event that says so."""
    try:
        content = json.loads(line)
        kind, body, at_s = str(content["kind"]), dict(content["body"]), float(content["at_s"])
        # What the ledger could not write down is found here.
        kind.encode()
        json.dumps(body, allow_nan=False)
        if not math.isfinite(at_s):
            raise ValueError(f"at_s is {at_s}")
        if kind != "progress":
            return Told(kind, body, at_s)
        return Told(kind, body, at_s, _step(body.get("step", 0)), _step(body.get("steps", 0)))
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        reason = f"A line of events.jsonl cannot be read ({type(error).__name__}); the job goes on."
        return Told("unreadable", {"reason": reason, "line": str(line[:_SHOWN])}, time.time())


def _step(value: Any) -> int:
    """A count that fits into a column; what is larger is shown as the largest."""
    return max(0, min(int(value), MOST))
