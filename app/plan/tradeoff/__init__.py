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


def front(rows: list[dict[str, Any]], quantity: str) -> list[dict[str, Any]]:
    """Rows that no quicker row beats in `quantity`, by time."""
    best: list[dict[str, Any]] = []
    for row in sorted((r for r in rows if r.get(quantity) is not None), key=lambda r: r["solver_s"]):
        if not best or row[quantity] < best[-1][quantity]:
            best.append(row)
    return best


def span(rows: list[dict[str, Any]], quantity: str) -> float:
    """Solver seconds of the dearest row on the front over those of the cheapest."""
    best = front(rows, quantity)
    return best[-1]["solver_s"] / best[0]["solver_s"] if best else 0.0


def off_front(rows: list[dict[str, Any]], preset: str, quantity: str) -> float | None:
    """A preset's error over the best that any row of its room, knowledge and light has in that time.

    The median over its runs: 1 is on the front. None where the preset has no such row.
    """
    distances = []
    for row in rows:
        if row["preset"] == preset and row.get(quantity) is not None:
            rivals = [r for r in rows if r.get(quantity) is not None and _alike(r, row)]
            best = min(r[quantity] for r in rivals if r["solver_s"] <= row["solver_s"])
            distances.append(row[quantity] / best)
    return float(np.median(distances)) if distances else None


def _alike(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(one[name] == other[name] for name in ("room", "information", "light"))


def headline(rows: list[dict[str, Any]]) -> str:
    """The README's table: what most people use, before a print."""
    return table(
        [row for row in rows if row["preset"] in ("draft", "standard") and row["light"] == "texture"]
    )


def table(rows: list[dict[str, Any]]) -> str:
    """The presets as a Markdown table: medians over rooms, one line a preset, level and light."""
    lines = [
        "| preset | information | light | solver | T error over departures | u error | p error | rooms |",
        "|---|---|---|---|---|---|---|---|",
    ]
    named = [row for row in rows if row["preset"]]
    for key in dict.fromkeys((r["preset"], r["information"], r["light"]) for r in named):
        own = [r for r in named if (r["preset"], r["information"], r["light"]) == key]
        solver_s = float(np.median([r["solver_s"] for r in own]))
        share = float(np.median([r["T_share"] for r in own]))
        u, p = (_median(own, name) for name in ("u", "p"))
        told = ["-" if value is None else f"{value:.2f}" for value in (u, p)]
        lines.append(
            f"| {' | '.join(key)} | {solver_s:.0f} s | {share:.2f} | {' | '.join(told)} | {len(own)} |"
        )
    return "\n".join(lines) + "\n"
