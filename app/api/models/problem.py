"""What every refusal and failure looks like: RFC 9457 problem details."""

from typing import Any

from pydantic import BaseModel, ConfigDict

MEDIA_TYPE = "application/problem+json"


class FieldError(BaseModel):
    """One field that was not accepted."""

    model_config = ConfigDict(extra="forbid")
    field: str
    message: str


class ProblemDetails(BaseModel):
    """RFC 9457 problem details. `detail` is written for the operator and is shown as it is.

    `current` and `sent` are both versions of what somebody else changed meanwhile (code `changed`).
    """

    model_config = ConfigDict(extra="forbid")
    type: str
    title: str
    status: int
    code: str
    detail: str
    cause: str
    next_step: str
    instance: str | None = None
    errors: list[FieldError] = []
    current: dict[str, Any] | None = None
    sent: dict[str, Any] | None = None
