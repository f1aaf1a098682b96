"""Looks at the ledger once for all listeners, so that fifty open pages cost as much as one."""

import asyncio
from collections import deque
from collections.abc import Callable

from app.jobs import Event, Ledger

LOOK_S = 0.2
KEPT = 2000
PAGE = 500


class EventFeed:
    """The newest events in memory; older ones come from the ledger. `catch_up` tells what could not be told."""

    def __init__(self, ledger: Ledger, catch_up: Callable[[], object] = lambda: None) -> None:
        self._ledger, self._catch_up = ledger, catch_up
        self._recent: deque[Event] = deque(maxlen=KEPT)
        self._newest: int | None = None
        self._looking: asyncio.Task[None] | None = None

    async def after(self, last: int) -> list[Event]:
        """Return what came after event `last`; wait a moment when there is nothing yet, then return []."""
        if self._newest is None:
            self._newest = await asyncio.to_thread(self._ledger.last_event)
        first_kept = self._recent[0].id if self._recent else self._newest + 1
        if last < first_kept - 1:
            return await asyncio.to_thread(self._ledger.events, after=last, limit=PAGE)
        if last >= self._newest:
            await self._look()
        return [event for event in self._recent if event.id > last][:PAGE]

    async def _look(self) -> None:
        if self._looking is None or self._looking.done():
            self._looking = asyncio.create_task(self._look_once())
        await asyncio.shield(self._looking)

    async def _look_once(self) -> None:
        await asyncio.sleep(LOOK_S)
        await asyncio.to_thread(self._catch_up)
        found = await asyncio.to_thread(self._ledger.events, after=self._newest or 0, limit=PAGE)
        if found:
            self._recent.extend(found)
            self._newest = found[-1].id
