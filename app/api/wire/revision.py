"""Revisions: who changes what somebody else changed meanwhile is told both versions."""

from typing import Annotated, Any

from fastapi import Header

from app.api.wire.problems import ApiError

IfMatch = Annotated[
    str | None,
    Header(
        max_length=400,
        description="The `revision` that the change is made to; left out, the newest one is changed.",
    ),
]


def check_revision(if_match: str | None, current: dict[str, Any], sent: dict[str, Any]) -> None:
    """Return when the change is made to `current`. Raises ApiError (412) that holds both versions."""
    if if_match is None or if_match.strip() == "*":
        return
    known = {part.strip().removeprefix("W/").strip('"') for part in if_match.split(",")}
    if current["revision"] not in known:
        raise ApiError("changed", "Somebody else changed this meanwhile.", current=current, sent=sent)


def etag(revision: str) -> dict[str, str]:
    """The header that tells a resource's revision."""
    return {"ETag": f'"{revision}"'}
