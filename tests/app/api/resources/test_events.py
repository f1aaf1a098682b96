"""One stream: what was missed is replayed, what happens arrives, ids are the ledger's rows."""

import contextlib
import itertools

from app.client import Client
from tests.app.api.conftest import Live


def test_what_was_missed_is_replayed_from_the_last_event_id(live: Live, airlens: Client):
    ledger = live.app.state.services.ledger
    rows = [ledger.append_event("log", {"text": str(n)}) for n in range(520)]
    with contextlib.closing(airlens.events(after=rows[0])) as stream:
        events = list(itertools.islice(stream, len(rows) - 1))
    assert [event.id for event in events] == rows[1:]
    assert events[-1].body == {"text": "519"}


def test_what_happens_reaches_every_listener_at_once(live: Live, airlens: Client):
    ledger = live.app.state.services.ledger
    with contextlib.closing(airlens.events(after=ledger.last_event())) as stream:
        row = ledger.append_event("device", {"device": "camera", "state": "ready"})
        event = next(stream)
        assert (event.id, event.kind) == (row, "device")
        other = ledger.append_event("log", {"text": "again"})
        assert next(stream).id == other


def test_a_stream_without_a_start_tells_only_what_is_new(live: Live, airlens: Client):
    ledger = live.app.state.services.ledger
    ledger.append_event("log", {"text": "old"})
    with airlens._http.stream("GET", "/events", timeout=100) as answer:
        lines = answer.iter_lines()
        assert next(lines) == "retry: 1000"
        ledger.append_event("log", {"text": "new"})
        data = next(line for line in lines if line.startswith("data: "))
    assert '"text":"new"' in data


def test_events_are_listed_too(live: Live, airlens: Client):
    row = live.app.state.services.ledger.append_event("log", {"text": "x"})
    listed = airlens._http.get("/events/list", params={"after": row - 1}).json()
    assert [event["id"] for event in listed] == [row]
