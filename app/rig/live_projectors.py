"""The projectors of a service: one live projector for each that lights a wall, spoken to side by side."""

import threading
from collections.abc import Callable, Mapping
from typing import Any

from app.rig.live_projector import LiveProjector, ProjectorReport, ProjectorState
from drivers.errors import DeviceNotFoundError
from drivers.projector.protocol import Projector


class LiveProjectors:
    """Live projectors by the number of the first view that sees by each. View 0's is there from the start."""

    def __init__(self, tell: Callable[[str, Mapping[str, Any]], object]) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._known = {0: LiveProjector(tell)}

    @property
    def first(self) -> LiveProjector:
        """The projector of the first view."""
        return self._known[0]

    @property
    def known(self) -> tuple[LiveProjector, ...]:
        """Those that were ever connected, by their view's number."""
        with self._lock:
            return tuple(self._known[number] for number in sorted(self._known))

    def there(self, view: int) -> LiveProjector:
        """The projector of a view. Raises DeviceNotFoundError for one that was never connected."""
        with self._lock:
            found = self._known.get(view)
        if found is None:
            raise DeviceNotFoundError(f"No projector is connected for view {view}. Connect it first.")
        return found

    def open(self, experiment: str, view: int, make: Callable[[], Projector]) -> ProjectorReport:
        """Speak to the projector of a view; the lines of other experiments are freed: they may be the same.

        Raises DeviceError.
        """
        for other in self.known:
            elsewhere = other.report.source not in (None, experiment)
            if elsewhere and other.report.state is not ProjectorState.closed:
                other.close()
        with self._lock:
            live = self._known.setdefault(view, LiveProjector(self._tell, view=view))
        return live.open(experiment, make)

    def held(self, experiment: str, view: int) -> Projector | None:
        """The projector of an experiment's view itself, where its line is open here."""
        with self._lock:
            found = self._known.get(view)
        return None if found is None else found.held(experiment)

    def close(self) -> None:
        """Free all lines; the lamps stay as they are."""
        for projector in self.known:
            projector.close()
