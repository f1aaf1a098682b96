"""Something that happened."""

from typing import Any

from app.api.models.strict import WireModel


class EventResource(WireModel):
    """Something that happened; `id` only grows."""

    id: int
    job: str | None
    attempt: int
    at_s: float
    kind: str
    body: dict[str, Any]
