"""What the kiosk page shows, seen from the service: the page reports, `show` waits."""

import threading
import time
from dataclasses import dataclass

import numpy as np

from drivers.display import Picture, picture_digest
from drivers.errors import DeviceSettingError, DeviceTimeoutError

ALIVE_S = 3.0


@dataclass(frozen=True)
class ScreenReport:
    """What the page says: the picture's id with the digest of what is drawn, or the reason why it refuses."""

    id: str
    digest: str
    reason: str
    width_px: int
    height_px: int
    device_pixel_ratio: float


class KioskScreen:
    """A PatternDisplay whose screen is a browser's. Threads: the service reports, the capture waits."""

    def __init__(self, timeout_s: float = 15.0) -> None:
        self._timeout_s = timeout_s
        self._changed = threading.Condition()
        self._picture: Picture | None = None
        self._digest = ""
        self._report: ScreenReport | None = None
        self._seen_s = float("-inf")

    @property
    def current(self) -> tuple[str, Picture | None]:
        """The digest and the picture that shall be on screen; asked by the page, which thus lives."""
        with self._changed:
            self._seen_s = time.monotonic()
            return self._digest, self._picture

    @property
    def wanted(self) -> tuple[str, tuple[int, int] | None]:
        """The digest and the size (columns, rows) of that picture, asked by somebody else."""
        with self._changed:
            picture = self._picture
            return self._digest, None if picture is None else (picture.shape[1], picture.shape[0])

    @property
    def report(self) -> ScreenReport | None:
        """The page's last word on the present picture."""
        with self._changed:
            return self._report

    def take_report(self, report: ScreenReport) -> None:
        """Take the page's word; one about another picture is out of date and dropped."""
        with self._changed:
            self._seen_s = time.monotonic()
            if report.id == self._digest:
                self._report = report
                self._changed.notify_all()

    @property
    def is_alive(self) -> bool:
        """Whether a page asked or reported within the last seconds."""
        return time.monotonic() - self._seen_s < ALIVE_S

    def put(self, picture: Picture) -> str:
        """Return the digest at once; the page draws the picture when it next asks."""
        digest = picture_digest(picture)
        with self._changed:
            if digest != self._digest:
                self._picture, self._digest, self._report = np.ascontiguousarray(picture), digest, None
        return digest

    def show(self, picture: Picture) -> str:
        """Return the digest once the page has drawn the picture and read it back the same."""
        digest = self.put(picture)
        with self._changed:
            answered = self._changed.wait_for(lambda: self._report is not None, self._timeout_s)
            report = self._report
        if not answered or report is None:
            raise DeviceTimeoutError(
                f"No kiosk page answered within {self._timeout_s:g} s. Open it on the projector: "
                "`airlens kiosk --help` shows the address."
            )
        if report.reason:
            raise DeviceSettingError(f"The kiosk page refuses: {report.reason}")
        if report.digest != digest:
            raise DeviceSettingError(
                f"The kiosk page drew other pixels ({report.digest[:12]}) than were sent ({digest[:12]}). "
                "Switch the browser's colour management and extensions off."
            )
        return digest

    def is_showing(self, digest: str) -> bool:
        """Return whether the page lives and has that picture on screen."""
        with self._changed:
            alive = time.monotonic() - self._seen_s < ALIVE_S
            report = self._report
            return alive and digest == self._digest and report is not None and report.digest == digest

    def close(self) -> None:
        """Take the picture away."""
        with self._changed:
            self._picture, self._digest, self._report = None, "", None
