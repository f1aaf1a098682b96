"""Kind `reconstruct`: the pipeline on the newest captures of an experiment, as `airlens reconstruct` runs it.

The result is made in a hidden folder beside the experiment's results and put in place by one rename.
A solver that keeps checkpoints goes on from its last one; another starts again.
"""

import itertools
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import Field

from app.files.toml import Strict, parse
from app.jobs.attempt import Attempt
from app.jobs.checkpoints import FolderStore

EXPERIMENT = True


class ReconstructSettings(Strict):
    """What to solve with; the presets are listed by `airlens reconstruct --help`."""

    preset: str = Field(default="auto", min_length=1, max_length=64, pattern="^[a-z0-9-]+$")


def read(settings: Mapping[str, Any]) -> ReconstructSettings:
    """Return the settings. Raises BadInputError."""
    return parse(dict(settings), ReconstructSettings, source="the settings of a reconstruction")


def target(order: Mapping[str, Any], folder: Path) -> Path:
    """Return the place among the experiment's results: by the time of submission, so that names sort."""
    moment = datetime.fromtimestamp(order["submitted_s"], UTC).strftime("%Y%m%dT%H%M%S")
    preset = order["settings"].get("preset", "auto")
    return Path(order["experiment"]) / "results" / f"{moment}-{preset}-{folder.name}"


def run(attempt: Attempt, settings: ReconstructSettings) -> dict[str, Any]:
    """Reconstruct; return how it ended."""
    # Imported here: reading a job's settings must not cost the start of the array library.
    from app.pipeline import reconstruct
    from core.result import Outcome

    def on_stage(stage: str) -> None:
        attempt.check_stop()
        attempt.tell("stage", {"stage": stage})

    told = itertools.count(1)

    def on_event(row: Mapping[str, Any]) -> None:
        if "excess_plane_k" in row:
            attempt.show(row["excess_plane_k"])
        numbers = {name: float(value) for name, value in row.items() if isinstance(value, int | float)}
        if numbers:
            # A march has no steps of equal worth: its rows are counted.
            step = int(numbers.pop("step", numbers.pop("iteration", 0))) or next(told)
            attempt.progress(step, int(numbers.pop("steps", 0)), numbers)

    done = reconstruct(
        attempt.experiment_folder(),
        settings.preset,
        on_stage=on_stage,
        on_event=on_event,
        into=attempt.output,
        store=FolderStore(attempt.checkpoints),
        should_stop=attempt.stop.is_set,
    )
    if done.solution.outcome is Outcome.stopped:
        attempt.check_stop()
    warm_k = done.solution.temperature_k
    ambient_k = done.problem.scene.air.ambient_temperature_k
    attempt.show((warm_k[:, warm_k.shape[1] // 2] - ambient_k).astype("float32"), last=True)
    ended = {"preset": done.finding.manifest["preset"], "outcome": done.solution.outcome.name}
    return ended | ({"no_report": done.no_report} if done.no_report else {})
