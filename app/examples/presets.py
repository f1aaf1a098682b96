"""A sweep over presets: what each costs and finds on one experiment, and the curves that the page draws.

    airlens demo
    python -m app.examples.presets airlens-data/experiments/demo curves.png --presets draft standard

Each preset leaves its result in the experiment, so `airlens serve` shows them side by side.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from app.pipeline import Reconstruction, reconstruct
from app.report.figures import as_png

# Columns of a history that tell what was done rather than how well it goes.
_COUNTS = ("elapsed_s", "step", "round", "moved", "of", "share", "seconds")


@dataclass(frozen=True)
class Row:
    """One preset: its time, how sure it is of the temperature, and errors where the truth is known."""

    preset: str
    solver_s: float
    temperature_std_k: float | None
    temperature_error_k: float | None
    velocity_error: float | None


def swept(folder: Path, presets: Sequence[str]) -> list[tuple[Row, Reconstruction]]:
    """Reconstruct with each preset in turn."""
    return [(_row(preset, done), done) for preset in presets for done in [reconstruct(folder, preset)]]


def _row(preset: str, done: Reconstruction) -> Row:
    scores, std = done.finding.scores, done.solution.temperature_std_k
    velocity = scores["u"] if scores else None
    return Row(
        preset,
        done.solution.solver_s,
        None if std is None else float(np.nanmean(std)),
        scores["T"]["rms_K"] if scores else None,
        velocity["rel"] if velocity else None,
    )


def curves_figure(made: Sequence[tuple[Row, Reconstruction]]) -> Figure:
    """What each solve recorded, over its time: one panel a preset."""
    figure = Figure(figsize=(6.5 * len(made), 4.5), layout="constrained")
    panels = figure.subplots(1, len(made), squeeze=False)[0]
    for panel, (row, done) in zip(panels, made, strict=True):
        history = done.solution.history
        names = {name for one in history for name, value in one.items() if isinstance(value, int | float)}
        for name in sorted(names.difference(_COUNTS)):
            points = [(one.get("elapsed_s", n), one[name]) for n, one in enumerate(history) if name in one]
            panel.plot(*zip(*points, strict=True), marker=".", label=name.replace("_", " "))
        panel.set_title(f"{row.preset}: {row.solver_s:.0f} s")
        panel.set_xlabel("time [s]")
        panel.set_yscale("symlog", linthresh=1e-3)
        if panel.lines:
            panel.legend(fontsize=7)
    return figure


def table(made: Sequence[tuple[Row, Reconstruction]]) -> str:
    """The rows as text."""

    def told(value: float | None) -> str:
        return "-" if value is None else f"{value:.3g}"

    lines = [f"{'preset':<10} {'solver [s]':>10} {'T sure to [K]':>14} {'T error [K]':>12} {'u error':>8}"]
    lines += [
        f"{row.preset:<10} {row.solver_s:>10.1f} {told(row.temperature_std_k):>14} "
        f"{told(row.temperature_error_k):>12} {told(row.velocity_error):>8}"
        for row, _ in made
    ]
    return "\n".join(lines)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("experiment", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--presets", nargs="+", default=["draft", "standard"])
    asked = parser.parse_args()
    made = swept(asked.experiment, asked.presets)
    asked.picture.write_bytes(as_png(curves_figure(made)))
    sys.stdout.write(table(made) + "\n")


if __name__ == "__main__":
    main()
