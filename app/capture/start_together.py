"""Several bursts that begin together: each waits until every other one has settled, or has ended."""

import threading
from collections.abc import Callable

_LOOK_EVERY_S = 0.05


class StartTogether:
    """For `bursts` threads: `ready` returns once all of them are ready or gone, or one of them is to stop."""

    def __init__(self, bursts: int, stop: Callable[[], bool]) -> None:
        self._waited_for, self._stop = bursts, stop
        self._changed = threading.Condition()

    def ready(self) -> None:
        """Called by a burst that has settled; its frames begin when this returns."""
        with self._changed:
            self._waited_for -= 1
            self._changed.notify_all()
            while self._waited_for > 0 and not self._stop():
                self._changed.wait(_LOOK_EVERY_S)

    def gone(self) -> None:
        """Called for a burst that ended before it was ready."""
        with self._changed:
            self._waited_for -= 1
            self._changed.notify_all()
