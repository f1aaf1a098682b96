"""One stream of server-sent events for everything. The id is the ledger's row, so nothing is missed."""

import asyncio
import json
import time
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Query
from fastapi.responses import StreamingResponse

from app.api.models.events import EventResource
from app.api.services import Given, Services
from app.api.wire.bodies import body
from app.jobs import Event

router = APIRouter(tags=["events"])
STREAM = "text/event-stream"
BODY = body(STREAM, "Server-sent events; `data` is an EventResource.", text=True)
COMMENT_S = 15.0
Row = Annotated[int | None, Query(ge=0, le=1 << 62)]


@router.get("/events/list")
def list_events(
    given: Given,
    after: Row = None,
    job: Annotated[str | None, Query(max_length=100)] = None,
    limit: Annotated[int, Query(ge=1, le=5000)] = 500,
) -> list[EventResource]:
    """List what happened after event `after`, oldest first."""
    return [_resource(event) for event in given.ledger.events(after=after or 0, job=job, limit=limit)]


@router.get("/events", response_class=StreamingResponse, responses=BODY)
async def stream_events(
    given: Given,
    after: Row = None,
    last_event_id: Annotated[str | None, Header(pattern=r"^[0-9]{1,18}$")] = None,
) -> StreamingResponse:
    """Stream events from now on, or all since `Last-Event-ID` (or `after`), then as they happen."""
    if last_event_id is not None:
        start = int(last_event_id)
    elif after is not None:
        start = after
    else:
        start = await asyncio.to_thread(given.ledger.last_event)
    return StreamingResponse(_stream(given, start), media_type=STREAM)


async def _stream(given: Services, last: int) -> AsyncIterator[str]:
    # The first bytes at once, so that the browser knows that it is connected.
    yield f"retry: 1000\nid: {last}\n\n"
    told_s = time.monotonic()
    while True:
        events = await given.feed.after(last)
        for event in events:
            last = event.id
            yield f"id: {event.id}\nevent: {_kind(event)}\ndata: {_resource(event).model_dump_json()}\n\n"
        if events:
            told_s = time.monotonic()
        elif time.monotonic() - told_s > COMMENT_S:
            told_s = time.monotonic()
            yield ": still here\n\n"


def _kind(event: Event) -> str:
    return "job" if event.job is not None else event.kind


def _resource(event: Event) -> EventResource:
    return EventResource(
        id=event.id,
        job=event.job,
        attempt=event.attempt,
        at_s=event.at_s,
        kind=event.kind,
        body=json.loads(json.dumps(dict(event.body))),
    )
