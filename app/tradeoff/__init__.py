"""What each preset bought on the reference rooms: the committed rows of `airlens bench tradeoff`.

The plan's predictions, the README's table and the operator's page read the same rows.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROWS = Path(__file__).resolve().parent / "rows.jsonl"


@dataclass(frozen=True)
class ExpectedError:
    """Median errors over rooms: T over the departures' rms, u and p relative; `rooms` is how many runs."""

    temperature: float
    velocity: float | None
    pressure: float | None
    rooms: int


def rows(path: Path = ROWS) -> list[dict[str, Any]]:
    """The committed rows; empty before the first sweep."""
    if not path.is_file():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]


def expected_error(preset: str, level: str, light: str) -> ExpectedError | None:
    """What a preset left on the reference rooms with that knowledge and light; None without such a row."""
    fitting = [r for r in rows() if (r["preset"], r["level"], r["light"]) == (preset, level, light)]
    if not fitting:
        return None
    return ExpectedError(
        temperature=float(np.median([r["T_share"] for r in fitting])),
        velocity=_median(fitting, "u"),
        pressure=_median(fitting, "p"),
        rooms=len(fitting),
    )


def _median(fitting: list[dict[str, Any]], name: str) -> float | None:
    known = [r[name] for r in fitting if r.get(name) is not None]
    return float(np.median(known)) if known else None
