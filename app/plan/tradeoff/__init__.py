"""What each preset bought: the committed rows of `airlens bench tradeoff`.

`rows.jsonl` is the whole sweep over the reference rooms A and C, on which the fit's settings were chosen;
`unseen.jsonl` the presets alone on rooms that nothing was set on, with entries as wrong as their deviations say
(`--presets --misread 1`). The plan's predictions, the README's table and the operator's page read both.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROWS, UNSEEN = (Path(__file__).resolve().parent / name for name in ("rows.jsonl", "unseen.jsonl"))


@dataclass(frozen=True)
class ExpectedError:
    """Median errors over rooms: T of the air over the largest stated contrast, u and p relative, of `rooms` runs.

    `worst_temperature`, `worst_velocity`: those of the worst room. `unseen`: nothing was set on these rooms, and
    entries were wrong as their deviations say.
    """

    temperature: float
    velocity: float | None
    pressure: float | None
    worst_temperature: float
    worst_velocity: float | None
    rooms: int
    unseen: bool


def rows(*paths: Path) -> list[dict[str, Any]]:
    """The rows of these files, or of the committed sweep over the reference rooms."""
    lines = [line for path in paths or (ROWS,) for line in path.read_text(encoding="utf-8").splitlines()]
    return [json.loads(line) for line in lines if line.strip()]


def expected_error(preset: str, level: str, light: str) -> ExpectedError | None:
    """What a preset left with that knowledge and light in `judged` rooms; None without such a row."""
    asked = preset, level, light
    fitting = judged([r for r in rows(ROWS, UNSEEN) if (r["preset"], r["level"], r["light"]) == asked])
    if not fitting:
        return None
    shares = [r["T_air_contrast"] for r in fitting if r["T_air_contrast"] is not None]
    return ExpectedError(
        temperature=float(np.median(shares)),
        velocity=_median(fitting, "u"),
        pressure=_median(fitting, "p"),
        worst_temperature=max(shares),
        worst_velocity=max((r["u"] for r in fitting if r["u"] is not None), default=None),
        rooms=len(fitting),
        unseen=fitting[0]["misread"] is not None,
    )


def judged(alike: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of rows that differ in the room alone, those of rooms that nothing was set on, if there are any."""
    return [row for row in alike if row.get("misread") is not None] or alike


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
    """The presets as a Markdown table: medians over `judged` rooms, one line a preset, level and light."""
    lines = [
        "| preset | information | light | solver | T error over departures | u error | p error | rooms |",
        "|---|---|---|---|---|---|---|---|",
    ]
    named = [row for row in rows if row["preset"]]
    for key in dict.fromkeys((r["preset"], r["information"], r["light"]) for r in named):
        own = judged([r for r in named if (r["preset"], r["information"], r["light"]) == key])
        solver_s = float(np.median([r["solver_s"] for r in own]))
        told = [_median(own, name) for name in ("T_air_share", "u", "p")]
        shown = ["-" if value is None else f"{value:.2f}" for value in told]
        lines.append(f"| {' | '.join(key)} | {solver_s:.0f} s | {' | '.join(shown)} | {_which(own)} |")
    return "\n".join(lines) + "\n"


def _which(own: list[dict[str, Any]]) -> str:
    """How many random rooms these are, or the names of those that settings were chosen on."""
    if own[0].get("misread") is not None:
        return f"{len(own)} random"
    return ", ".join(row["room"] for row in own)
