"""Jobs, and what may be asked of them."""

from typing import Any, Literal

from pydantic import Field

from app.api.models.strict import Named, WireModel

State = Literal["queued", "running", "pausing", "cancelling", "paused", "lost", "done", "failed", "cancelled"]


class JobResource(WireModel):
    """One job. `state` is the ledger's word; `reason` says why it waits or how it ended."""

    job: str
    number: int
    kind: str
    settings: dict[str, Any]
    experiment: str | None
    title: str
    group: str | None
    state: State
    priority: int
    attempt: int
    losses: int
    device: str | None
    step: int
    steps: int
    progress: float
    reason: str
    submitted_s: float
    started_s: float | None
    finished_s: float | None


class NewJob(WireModel):
    """What to compute. The same `key` twice gives the first job, so that a request may be repeated."""

    kind: str = Field(min_length=1, max_length=64)
    settings: dict[str, Any] = Field(default_factory=dict)
    experiment: Named | None = None
    title: str = Field(default="", max_length=200)
    priority: int = Field(default=0, ge=-1000, le=1000)
    key: str | None = Field(default=None, min_length=8, max_length=100)
    group: Named | None = None


class JobChange(WireModel):
    """A new priority, or a new place: before another waiting job, or last."""

    priority: int | None = Field(default=None, ge=-1000, le=1000)
    before: Named | None = None


class Curves(WireModel):
    """What a job told while it ran, as columns of equal length; null where a value was not finite."""

    step: list[int]
    values: dict[str, list[float | None]]
