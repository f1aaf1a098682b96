"""Kind `reconstruct`: the pipeline on the newest captures of an experiment, as `airlens reconstruct` runs it.

The result is made in a hidden folder beside the experiment's results and put in place by one rename. A solver goes
on from what an earlier attempt kept.
"""

import itertools
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field

from app.files.toml import Strict, parse
from app.jobs.attempt import SHOWN_EVERY_S, Attempt, AttemptStoppedError
from app.jobs.checkpoints import FolderStore
from app.reconstruct.names import known

if TYPE_CHECKING:
    from core.result import Solution

EXPERIMENT = True
# A share of the work is told in so many parts.
_PARTS = 1000


class ReconstructSettings(Strict):
    """What to solve with; the presets are listed by `airlens reconstruct --help`."""

    preset: str = Field(default="auto", min_length=1, max_length=64, pattern="^[a-z0-9-]+$")
    sequence: bool = False


def read(settings: Mapping[str, Any]) -> ReconstructSettings:
    """Return the settings. Raises BadInputError."""
    found = parse(dict(settings), ReconstructSettings, source="the settings of a reconstruction")
    known(found.preset)
    return found


def target(order: Mapping[str, Any], folder: Path) -> Path:
    """Return the place among the experiment's results: by the time of submission, so that names sort."""
    moment = datetime.fromtimestamp(order["submitted_s"], UTC).strftime("%Y%m%dT%H%M%S")
    preset = order["settings"].get("preset", "auto")
    return Path(order["experiment"]) / "results" / f"{moment}-{preset}-{folder.name}"


def run(attempt: Attempt, settings: ReconstructSettings) -> dict[str, Any]:
    """Reconstruct; return how it ended. Raises AttemptStoppedError."""
    # Imported here: reading a job's settings must not cost the start of the array library.
    from app.experiment.folder import open_experiment
    from app.pipeline import reconstruct
    from app.plan.under_way import process_age_s
    from core.watch import StoppedError, Watch

    experiment = attempt.experiment_folder()
    ambient_k = open_experiment(experiment).settings.scene.air.ambient_temperature_k
    told = _Teller(attempt, ambient_k)
    watch = Watch(told, attempt.stop.is_set, FolderStore(attempt.checkpoints))
    try:
        done = reconstruct(
            experiment,
            settings.preset,
            sequence=settings.sequence,
            watch=watch,
            into=attempt.output,
            start_s=process_age_s(),
        )
    except StoppedError as error:
        raise AttemptStoppedError from error
    told.show(done.solution, last=True)
    ended = {"preset": done.finding.manifest["preset"], "outcome": done.solution.outcome.name}
    return ended | ({"no_report": done.no_report} if done.no_report else {})


class _Teller:
    """Turns a run's rows into events: what is being done, how much is done, how long yet, how the field grows."""

    def __init__(self, attempt: Attempt, ambient_k: float) -> None:
        self._attempt, self._ambient_k = attempt, ambient_k
        self._doing, self._count, self._shown_s = "", itertools.count(1), float("-inf")

    def __call__(self, row: Mapping[str, float | str], growing: "Callable[[], Solution] | None") -> None:
        doing = str(row["doing"])
        numbers = {name: float(value) for name, value in row.items() if not isinstance(value, str)}
        left_s = numbers.pop("left_s", None)
        left = {} if left_s is None else {"left_s": left_s}
        if doing != self._doing:
            self._doing = doing
            self._attempt.tell("stage", {"stage": doing, **left})
        if numbers:
            counted = next(self._count)
            share = numbers.pop("share", None)
            step, steps = (counted, 0) if share is None else (round(_PARTS * share), _PARTS)
            self._attempt.progress(step, steps, numbers | left)
        if growing is not None and time.monotonic() - self._shown_s >= SHOWN_EVERY_S:
            self.show(growing())
            self._shown_s = time.monotonic()

    def show(self, air: "Solution", *, last: bool = False) -> None:
        """Show the middle plane [x, z] of the temperature above ambient."""
        plane_k = air.temperature_k[:, air.temperature_k.shape[1] // 2] - self._ambient_k
        self._attempt.show(plane_k.astype("float32"), last=last)
