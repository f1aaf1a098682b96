"""One error shape for everything that can go wrong: RFC 9457 problem JSON with code, cause and next step."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from starlette.exceptions import HTTPException

from app.api.models.problem import FieldError, ProblemDetails


@dataclass(frozen=True)
class Kind:
    """A stable code's status, title and usual next step."""

    status: int
    title: str
    next_step: str


KINDS: Mapping[str, Kind] = {
    "bad_request": Kind(400, "The request cannot be read", "Correct the request and send it again."),
    "token_missing": Kind(
        401, "No valid token", "Open the address that `airlens serve` prints, or send the token as a bearer."
    ),
    "host_refused": Kind(
        403, "This host name is not served", "Use the address that `airlens serve` printed, unchanged."
    ),
    "origin_refused": Kind(
        403, "Requests from this page are refused", "Open the address of the service itself in the browser."
    ),
    "not_found": Kind(404, "Not found", "List the parent resource to see what there is."),
    "method_not_allowed": Kind(405, "This cannot be done here", "Use one of the methods in `Allow`."),
    "conflict": Kind(409, "The state does not allow this", "Read the resource's state and try again."),
    "changed": Kind(
        412, "It was changed meanwhile", "Look at both versions, then send the change again or leave it."
    ),
    "unconfirmed": Kind(
        409, "These devices are not confirmed", "Confirm them, if this experiment may open them."
    ),
    "not_writable": Kind(
        409, "The disk does not allow this", "Give the service the right to write there, then try again."
    ),
    "too_large": Kind(413, "The content is too large", "Send less, or a cropped or binned version."),
    "media_type_refused": Kind(415, "This kind of content is not accepted", "Send one of the kinds named."),
    "invalid": Kind(422, "A value is not valid", "Correct the fields that are named, and send it again."),
    "content_refused": Kind(
        422, "The content cannot be used", "Check the file in the program that wrote it."
    ),
    "bad_input": Kind(422, "An input cannot be used", "Correct the input that the cause names."),
    "rate_limited": Kind(429, "Too many requests", "Wait for the seconds in `Retry-After`."),
    "internal": Kind(
        500, "The service has a fault", "Try again; if it stays, send the service's log with this instance."
    ),
    "failed": Kind(500, "The operation failed", "Follow the cause, then try again."),
    "device_failed": Kind(503, "A device failed", "Check the device and reconnect it."),
    "unavailable": Kind(503, "Not available now", "Try again in a moment."),
    "disk_full": Kind(507, "The disk is full", "Free space on the data disk; nothing half-written was kept."),
}


class ApiError(HTTPException):
    """A foreseen refusal or failure; raised anywhere below the guard, shown as a `ProblemDetails`."""

    def __init__(
        self,
        code: str,
        cause: str,
        next_step: str | None = None,
        *,
        errors: list[FieldError] | None = None,
        headers: Mapping[str, str] | None = None,
        current: dict[str, Any] | None = None,
        sent: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(KINDS[code].status, cause, dict(headers) if headers else None)
        self.code = code
        self.cause = cause
        self.next_step = next_step
        self.errors = errors or []
        self.current, self.sent = current, sent


def problem_of(error: ApiError, instance: str | None = None) -> ProblemDetails:
    """Return the problem that describes `error`."""
    kind = KINDS[error.code]
    next_step = error.next_step or kind.next_step
    cause = error.cause.strip()
    detail = cause if next_step in cause else f"{cause} {next_step}"
    return ProblemDetails(
        type=f"urn:airlens:problem:{error.code}",
        title=kind.title,
        status=kind.status,
        code=error.code,
        detail=detail,
        cause=cause,
        next_step=next_step,
        instance=instance,
        errors=error.errors,
        current=error.current,
        sent=error.sent,
    )


def body_of(error: ApiError, instance: str | None = None) -> bytes:
    """Return `problem_of(error)` as UTF-8 JSON; characters that cannot be encoded are replaced."""
    content = problem_of(error, instance).model_dump(exclude_none=True)
    return json.dumps(content, ensure_ascii=True).encode()
