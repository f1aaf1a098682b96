"""Kind `plan`: what an experiment would see and cost, as `airlens plan` says it; kept as plan.json beside it."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from app.files.toml import Strict, parse
from app.jobs.attempt import Attempt

EXPERIMENT = True


class PlanSettings(Strict):
    """The largest temperature difference to expect [K]; without it what the scene states."""

    excess_k: float | None = Field(default=None, gt=0, lt=5000)


def read(settings: Mapping[str, Any]) -> PlanSettings:
    """Return the settings. Raises BadInputError."""
    return parse(dict(settings), PlanSettings, source="the settings of a plan")


def run(attempt: Attempt, settings: PlanSettings) -> dict[str, Any]:
    """Plan; return the verdicts."""
    # Imported here: reading a job's settings must not cost the start of the array library.
    from app.plan.make import plan

    def on_stage(stage: str) -> None:
        attempt.check_stop()
        attempt.tell("stage", {"stage": stage})

    made = plan(attempt.experiment_folder(), excess_k=settings.excess_k, on_stage=on_stage)
    return {"verdicts": made.verdicts}
