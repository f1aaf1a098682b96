"""The cameras of a service: one live camera a view, so that several pictures are looked at side by side."""

import contextlib
import threading
from collections.abc import Callable, Mapping
from typing import Any

from app.rig.live_camera import CameraState, CameraStatus, LiveCamera
from drivers.errors import DeviceBusyError, DeviceNotFoundError
from drivers.protocols import Camera


class LiveCameras:
    """Live cameras by the number of their view. That of the first is there from the start."""

    def __init__(
        self,
        tell: Callable[[str, Mapping[str, Any]], object],
        busy: Callable[[], bool] = lambda: False,
    ) -> None:
        self._tell, self._busy = tell, busy
        self._lock = threading.Lock()
        self._known = {0: LiveCamera(tell, busy)}

    @property
    def first(self) -> LiveCamera:
        """The camera of the first view."""
        return self._known[0]

    @property
    def known(self) -> tuple[LiveCamera, ...]:
        """Those that were ever asked for, by their view's number."""
        with self._lock:
            return tuple(self._known[number] for number in sorted(self._known))

    def of(self, view: int) -> LiveCamera:
        """The camera of a view, made when it is first asked for."""
        with self._lock:
            if view not in self._known:
                self._known[view] = LiveCamera(self._tell, self._busy, view)
            return self._known[view]

    def there(self, view: int) -> LiveCamera:
        """The same of one that was opened before. Raises DeviceNotFoundError."""
        with self._lock:
            found = self._known.get(view)
        if found is None:
            raise DeviceNotFoundError(f"No camera is open for view {view}. Connect it first.")
        return found

    def open(
        self, experiment: str, view: int, make: Callable[[], Camera], air: str = "still"
    ) -> CameraStatus:
        """Open the camera of a view; those of other experiments are let go, for they may be the same devices.

        Raises DeviceError.
        """
        for other in self.known:
            elsewhere = other.status.experiment not in (None, experiment)
            if other.view != view and elsewhere and other.status.state is not CameraState.closed:
                with contextlib.suppress(DeviceBusyError):
                    other.close()
        return self.of(view).open(experiment, make, air)

    def close(self) -> None:
        """Let all cameras go. Raises DeviceBusyError during a capture."""
        for camera in self.known:
            camera.close()

    def give_up(self, reason: str) -> None:
        """Leave behind those with which a capture or calibration does not end."""
        for camera in self.known:
            if camera.status.state is CameraState.capturing:
                camera.give_up(reason)
