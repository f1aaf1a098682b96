"""One open camera that many may watch and one may use: a thread grabs while somebody looks, newest wins.

States: closed -> opening -> ready <-> capturing; any -> failed (unplugged, timed out) -> opening again.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from app.rig.frame_statistics import LiveFrame, jpeg_of, statistics_of
from drivers.errors import DeviceBusyError, DeviceError, DeviceNotFoundError, DeviceSettingError, FrameError
from drivers.protocols import Camera, Frame
from drivers.settings import set_on

LONGEST_RATE_HZ = 30.0
# While this machine computes: enough for the eyes, and a third of the cost.
BUSY_RATE_HZ = 10.0
ASK_EVERY_S = 1.0


class CameraState(StrEnum):
    """Shown to the operator by the same word."""

    closed = "closed"
    opening = "opening"
    ready = "ready"
    capturing = "capturing"
    failed = "failed"


@dataclass(frozen=True)
class CameraStatus:
    """What is known of the camera; settings are read back from it."""

    state: CameraState
    experiment: str | None = None
    name: str | None = None
    width_px: int | None = None
    height_px: int | None = None
    bits: int | None = None
    frame_rate_hz: float | None = None
    exposure_s: float | None = None
    gain: float | None = None
    reason: str = ""


@dataclass(frozen=True)
class _Wish:
    """What the operator set, and what the camera had been opened with."""

    opened: tuple[float | None, float | None]
    exposure_s: float | None = None
    gain: float | None = None


class LiveCamera:
    """The one camera of a service. `tell(kind, body)` hears of every change of state.

    What `set` sets stays when the same rig is opened again, until its experiment.toml names other settings.
    `busy` says whether a job runs on this machine: then the live picture is shown less often.
    """

    def __init__(
        self,
        tell: Callable[[str, Mapping[str, Any]], object],
        busy: Callable[[], bool] = lambda: False,
    ) -> None:
        self._tell = tell
        self._busy, self._asked_s, self._rate_hz = busy, float("-inf"), LONGEST_RATE_HZ
        self._camera: Camera | None = None
        self._status = CameraStatus(CameraState.closed)
        self._use = threading.Lock()  # one at a time speaks to the device
        self._frame: LiveFrame | None = None
        self._listeners: dict[int, Callable[[LiveFrame], object]] = {}
        self._stretches: dict[int, bool] = {}
        self._wake = threading.Condition()
        self.air = "still"
        self.newest: Frame | None = None
        self._generation = 0
        self._thread: threading.Thread | None = None
        self._number = 0
        self._wishes: dict[str, _Wish] = {}

    @property
    def status(self) -> CameraStatus:
        """The present state."""
        return self._status

    def open(self, experiment: str, make: Callable[[], Camera], air: str = "still") -> CameraStatus:
        """Open (or open again) the camera that `make` returns; `air` is what a simulated room does.

        Raises DeviceError when it fails.
        """
        if self._status.state is CameraState.capturing:
            raise DeviceBusyError("The camera is taking a capture. Wait for its end, or abort it.")
        self.close()
        self.air, self.newest = air, None
        self._change(CameraStatus(CameraState.opening, experiment))
        try:
            camera = make()
            told = self._wish_again(camera, experiment)
        except Exception as error:
            self._change(CameraStatus(CameraState.failed, experiment, reason=str(error)))
            raise
        with self._use:
            self._camera = camera
            self._generation += 1
        self._change(replace(_status_of(camera, CameraState.ready, experiment), reason=told))
        self._thread = threading.Thread(
            target=self._run, args=(camera, self._generation), name="live-camera", daemon=True
        )
        self._thread.start()
        return self._status

    def close(self) -> CameraStatus:
        """Close the camera; its viewers see no more frames until it is opened again."""
        with self._use:
            camera, self._camera = self._camera, None
            self._generation += 1
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=5)
        if camera is not None:
            camera.close()
        if self._status.state is not CameraState.closed:
            self._change(CameraStatus(CameraState.closed))
        return self._status

    def set(self, exposure_s: float | None, gain: float | None) -> CameraStatus:
        """Set what is given and return what the camera granted. Raises DeviceError."""
        with self.using(CameraState.ready) as camera:
            set_on(camera, exposure_s, gain)
            before = self._wishes[self._status.experiment or ""]
            self._wishes[self._status.experiment or ""] = _Wish(
                before.opened,
                before.exposure_s if exposure_s is None else exposure_s,
                before.gain if gain is None else gain,
            )
        return self._status

    @contextlib.contextmanager
    def using(self, state: CameraState = CameraState.capturing) -> Iterator[Camera]:
        """Hold the camera alone, shown as `state`. Raises DeviceNotFoundError, DeviceBusyError."""
        if self._status.state is CameraState.capturing:
            raise DeviceBusyError("The camera is taking a capture. Wait for its end, or abort it.")
        with self._use:
            camera, experiment = self._camera, self._status.experiment
            if camera is None:
                raise DeviceNotFoundError("No camera is open. Connect the rig of an experiment first.")
            self._change(_status_of(camera, state, experiment))
            try:
                yield camera
            except DeviceSettingError:
                raise  # a value that it refuses leaves the camera as it was
            except DeviceError as error:
                self._fail(error)
                raise
            finally:
                if self._status.state is not CameraState.failed and self._camera is camera:
                    self._change(_status_of(camera, CameraState.ready, experiment))

    def show(self, frame: Frame) -> None:
        """Show a frame to whoever looks; captures call it with theirs, so that the picture stays alive."""
        self.newest = frame
        if not self._listeners:
            return
        self._number += 1
        wanted = {*self._stretches.values()} or {False}
        shown = LiveFrame(
            self._number,
            frame.timestamp_s,
            statistics_of(frame),
            {stretch: jpeg_of(frame, stretch) for stretch in wanted},
            *frame.pixels.shape,
        )
        self._frame = shown
        for listener in list(self._listeners.values()):
            listener(shown)

    def watch(self, key: int, listener: Callable[[LiveFrame], object], stretch: bool = False) -> None:
        """Call `listener` with every frame from now on, from another thread, until `leave(key)`."""
        with self._wake:
            self._stretches[key] = stretch
            self._listeners[key] = listener
            self._wake.notify_all()

    def stretch(self, key: int, stretch: bool) -> None:
        """Change how frames look to one watcher."""
        if key in self._listeners:
            self._stretches[key] = stretch

    def leave(self, key: int) -> None:
        """Stop watching; without watchers the camera rests."""
        self._listeners.pop(key, None)
        self._stretches.pop(key, None)

    def _wish_again(self, camera: Camera, experiment: str) -> str:
        """Set what the operator had set on this rig; return why not, where the camera refuses it."""
        opened = (camera.exposure_s, camera.gain)
        wish = self._wishes.get(experiment)
        if wish is None or wish.opened != opened:
            self._wishes[experiment] = _Wish(opened)
            return ""
        try:
            set_on(camera, wish.exposure_s, wish.gain)
        except DeviceSettingError as error:
            return f"The settings that were chosen before are not in use. {error}"
        return ""

    def _run(self, camera: Camera, generation: int) -> None:
        while self._generation == generation:
            with self._wake:
                if not self._listeners:
                    self._wake.wait(0.2)
                    continue
            started_s = time.monotonic()
            try:
                frame = self._grab(camera, generation)
            except DeviceError as error:
                self._fail(error)
                return
            if frame is not None:
                self.show(frame)
            time.sleep(max(0.001, 1 / self._rate() - (time.monotonic() - started_s)))

    def _rate(self) -> float:
        now_s = time.monotonic()
        if now_s - self._asked_s > ASK_EVERY_S:
            self._asked_s = now_s
            self._rate_hz = BUSY_RATE_HZ if self._busy() else LONGEST_RATE_HZ
        return self._rate_hz

    def _grab(self, camera: Camera, generation: int) -> Frame | None:
        with self._use:
            if self._generation != generation:
                return None
            try:
                return camera.grab()
            except FrameError:
                return None  # The next frame is as good for the eyes.

    def _fail(self, error: DeviceError) -> None:
        self._generation += 1
        self._change(CameraStatus(CameraState.failed, self._status.experiment, reason=str(error)))

    def _change(self, status: CameraStatus) -> None:
        told = status.state is not self._status.state or status.reason != self._status.reason
        self._status = status
        if told:
            self._tell("device", {"device": "camera", "state": status.state.value, "reason": status.reason})


def _status_of(camera: Camera, state: CameraState, experiment: str | None) -> CameraStatus:
    info = camera.info
    return CameraStatus(
        state,
        experiment,
        info.name,
        info.width_px,
        info.height_px,
        info.bits,
        info.frame_rate_hz,
        camera.exposure_s,
        camera.gain,
    )
