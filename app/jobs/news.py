"""News of devices and captures for the ledger's events: told as soon as they can be, never in the way."""

import logging
import threading
from collections.abc import Mapping
from typing import Any

from app.jobs.errors import LedgerError
from app.jobs.ledger import Ledger

_log = logging.getLogger(__name__)


class News:
    """Appends events. Where the ledger cannot be written, the newest of each thing is told later.

    What a camera or a capture is doing is its own state; a full disk delays the news of it, and nothing else.
    """

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger
        self._lock = threading.Lock()
        self._untold: dict[tuple[str, Any], tuple[str, dict[str, Any]]] = {}

    def tell(self, kind: str, body: Mapping[str, Any]) -> None:
        """Append an event, now or when there is room again."""
        with self._lock:
            self._untold[kind, body.get("device")] = (kind, dict(body))
            self._catch_up()

    def catch_up(self) -> None:
        """Tell what could not be told before."""
        if self._untold:
            with self._lock:
                self._catch_up()

    def _catch_up(self) -> None:
        for key, (kind, body) in list(self._untold.items()):
            try:
                self._ledger.append_event(kind, body)
            except (LedgerError, OSError) as error:
                _log.error("%s", error)
                return
            del self._untold[key]
