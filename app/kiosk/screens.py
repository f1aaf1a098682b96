"""The kiosk screens of a service: one a projector, by the number of the first view that sees by it."""

import threading

from app.kiosk.screen import KioskScreen

# As many as a service may be asked for.
MOST = 100


class KioskScreens:
    """Each is made when it is first asked for. `timeout_s` is how long a picture is waited for."""

    def __init__(self, timeout_s: float = 15.0) -> None:
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self._known: dict[int, KioskScreen] = {}

    def of(self, number: int) -> KioskScreen:
        """The screen of a projector."""
        with self._lock:
            if number not in self._known:
                self._known[number] = KioskScreen(self._timeout_s)
            return self._known[number]


def page_of(number: int) -> str:
    """Where the page of a projector's screen is; that of the first one needs no number."""
    return f"/kiosk/{number}/page" if number else "/kiosk/page"
