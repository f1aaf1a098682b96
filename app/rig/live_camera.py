"""One open camera that many may watch and one may use: a thread grabs while somebody looks, newest wins.

`CAMERA` is the table of its states: what may happen in which, and where that leads. What it does not name is
refused. A camera that fails or hangs is left behind, and can be connected again.
"""

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from app.rig.frame_statistics import LiveFrame, jpeg_of, statistics_of
from app.states import StateMachine
from drivers.errors import (
    DeviceBusyError,
    DeviceError,
    DeviceNotFoundError,
    DeviceSettingError,
    DeviceTimeoutError,
    FrameError,
)
from drivers.protocols import Camera, Frame
from drivers.settings import set_on

LONGEST_RATE_HZ = 30.0
# While this machine computes or a capture is taken: enough for the eyes, and a third of the cost.
BUSY_RATE_HZ = 10.0
# Of a capture's time, at most this part goes into showing its frames: the camera's buffers fill meanwhile.
SHOWN_SHARE = 0.2
ASK_EVERY_S = 1.0
ANSWER_LIMIT_S = 10.0
_log = logging.getLogger(__name__)


class CameraState(StrEnum):
    """Shown to the operator by the same word."""

    closed = "closed"
    opening = "opening"
    ready = "ready"
    capturing = "capturing"
    failed = "failed"


class CameraEvent(StrEnum):
    """What happens to the camera: `connect` and `disconnect` are asked for."""

    connect = "connect"
    opened = "be opened"
    take = "take with it"
    give_back = "give back"
    lose = "lose"
    disconnect = "disconnect"
    give_up = "give up"


_S, _E = CameraState, CameraEvent
CAMERA = StateMachine(
    name="The camera",
    table={
        _S.closed: {_E.connect: _S.opening, _E.disconnect: _S.closed, _E.give_up: _S.closed},
        _S.opening: {
            _E.opened: _S.ready,
            _E.lose: _S.failed,
            _E.disconnect: _S.closed,
            _E.give_up: _S.failed,
        },
        _S.ready: {
            _E.connect: _S.opening,
            _E.take: _S.capturing,
            _E.lose: _S.failed,
            _E.disconnect: _S.closed,
            _E.give_up: _S.failed,
        },
        _S.capturing: {_E.give_back: _S.ready, _E.lose: _S.failed, _E.give_up: _S.failed},
        _S.failed: {_E.connect: _S.opening, _E.disconnect: _S.closed, _E.give_up: _S.failed},
    },
    asked=frozenset({_E.connect, _E.disconnect}),
    error=DeviceBusyError,
)


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
    view: int = 0


@dataclass(frozen=True)
class _Wish:
    """What the operator set, and what the camera had been opened with."""

    opened: tuple[float | None, float | None]
    exposure_s: float | None = None
    gain: float | None = None


@dataclass(eq=False)
class _Opened:
    """An open camera. One at a time speaks to it; who hangs in it hangs alone once it has `ended`."""

    camera: Camera
    use: threading.Lock = field(default_factory=threading.Lock)
    ended: bool = False
    status: CameraStatus | None = None


class LiveCamera:
    """The camera of one view, by its number. `tell(kind, body)` hears of every change of state.

    What `set` sets stays when the same rig is opened again, until its experiment.toml names other settings.
    `busy` says whether a job runs on this machine: then the live picture is shown less often.
    """

    def __init__(
        self,
        tell: Callable[[str, Mapping[str, Any]], object],
        busy: Callable[[], bool] = lambda: False,
        view: int = 0,
    ) -> None:
        self._tell, self.view = tell, view
        self._busy, self._asked_s, self._rate_hz = busy, float("-inf"), LONGEST_RATE_HZ
        self._guard = threading.RLock()  # of the fields below, held for moments
        self._status = CameraStatus(CameraState.closed, view=view)
        self._told: tuple[CameraState, str] = (CameraState.closed, "")
        self._opened: _Opened | None = None
        self._opener: object = (
            None  # who may speak of the camera's state: the newest opening, then its camera
        )
        self._frame: LiveFrame | None = None
        self._listeners: dict[int, Callable[[LiveFrame], object]] = {}
        self._stretches: dict[int, bool] = {}
        self._wake = threading.Condition()
        self.air = "still"
        self.newest: Frame | None = None
        self._number, self._rests_until_s = 0, float("-inf")
        self._wishes: dict[str, _Wish] = {}

    @property
    def status(self) -> CameraStatus:
        """The present state."""
        return self._status

    def open(self, experiment: str, make: Callable[[], Camera], air: str = "still") -> CameraStatus:
        """Open (or open again) the camera that `make` returns; `air` is what a simulated room does.

        Raises DeviceError when it fails, DeviceBusyError while it is being opened or taking a capture.
        """
        with self._guard:
            state = CAMERA.after(self._status.state, CameraEvent.connect)
            before, mine = self._opened, object()
            self._opened, self._opener = None, mine
            self._status = CameraStatus(state, experiment, view=self.view)
        self._tell_state()
        self._let_go(before)
        self.air, self.newest = air, None
        try:
            camera = make()
            told = self._wish_again(camera, experiment)
            status = replace(self._status_of(camera, experiment), reason=told)
        except Exception as error:
            self._fail(mine, error)
            raise
        opened = _Opened(camera)
        with self._guard:
            wanted = self._opener is mine
            if wanted:
                state = CAMERA.after(self._status.state, CameraEvent.opened)
                self._opened = self._opener = opened
                self._status = replace(status, state=state)
        if not wanted:
            self._let_go(opened)
            raise DeviceBusyError("The camera was disconnected while it was being opened. Connect it again.")
        self._tell_state()
        threading.Thread(target=self._run, args=(opened,), name="live-camera", daemon=True).start()
        return self._status

    def close(self) -> CameraStatus:
        """Close the camera; its viewers see no more frames until it is opened again.

        Raises DeviceBusyError during a capture.
        """
        self._leave(CameraEvent.disconnect, "")
        return self._status

    def give_up(self, reason: str) -> None:
        """Leave a camera behind that does not answer. Whoever still waits for it can change nothing here."""
        self._leave(CameraEvent.give_up, reason)

    def _leave(self, event: CameraEvent, reason: str) -> None:
        with self._guard:
            before, opened = self._status, self._opened
            state = CAMERA.after(before.state, event)
            self._opened, self._opener = None, None
            experiment = before.experiment if state is CameraState.failed else None
            self._status = CameraStatus(state, experiment, reason=reason, view=self.view)
        if before != self._status:
            self._tell_state()
        self._let_go(opened, wait_s=5.0 if event is CameraEvent.disconnect else 0.0)

    def _let_go(self, opened: "_Opened | None", wait_s: float = 5.0) -> None:
        """Close a camera that nobody uses any more; one that hangs is left to whoever waits for it."""
        if opened is None:
            return
        opened.ended = True
        if opened.use.acquire(timeout=wait_s):
            try:
                opened.camera.close()
            except (DeviceError, OSError) as error:
                _log.warning("The camera did not close: %s", error)
            finally:
                opened.use.release()

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
        with self._guard:
            opened = self._opened
            if opened is None and self._status.state in (CameraState.closed, CameraState.failed):
                raise DeviceNotFoundError("No camera is open. Connect the rig of an experiment first.")
            taken = CAMERA.after(self._status.state, CameraEvent.take)
            if state is taken:
                self._status = replace(self._status, state=taken)
        assert opened is not None  # noqa: S101 - ready and capturing have one
        self._tell_state()
        if not opened.use.acquire(timeout=ANSWER_LIMIT_S):
            error = DeviceTimeoutError(
                f"The camera has not answered for {ANSWER_LIMIT_S:g} s. Check its cable, then connect it again."
            )
            self._fail(opened, error)
            raise error
        try:
            yield opened.camera
        except DeviceSettingError:
            raise  # a value that it refuses leaves the camera as it was
        except DeviceError as error:
            self._fail(opened, error)
            raise
        finally:
            opened.use.release()
            self._give_back(opened)

    def _give_back(self, opened: "_Opened") -> None:
        """Show the camera as ready, with its settings, unless it was lost or left meanwhile.

        A burst that loses its camera ends, and raises nothing: what is gone is found out here.
        """
        try:
            opened.status = self._status_of(opened.camera, self._status.experiment)
        except DeviceNotFoundError as error:
            self._fail(opened, error)
        except (DeviceError, OSError) as error:
            _log.warning("The camera does not tell its settings: %s", error)
        with self._guard:
            if self._opened is not opened or opened.ended:
                return
            if self._status.state is CameraState.capturing:
                state = CAMERA.after(self._status.state, CameraEvent.give_back)
                self._status = replace(opened.status or self._status, state=state)
            elif opened.status:
                self._status = replace(opened.status, state=self._status.state)
        self._tell_state()

    def show(self, frame: Frame) -> None:
        """Show a frame to whoever looks; captures call it with theirs, so that the picture stays alive.

        Of a capture's frames some are shown, so that showing them does not lose others.
        """
        self.newest = frame
        began_s = time.monotonic()
        capturing = self._status.state is CameraState.capturing
        if not self._listeners or (capturing and began_s < self._rests_until_s):
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
        for key, listener in list(self._listeners.items()):
            try:
                listener(shown)
            except Exception:
                # One who cannot look any more keeps neither the others nor a capture from going on.
                _log.exception("a watcher of the live picture")
                self.leave(key)
        rest_s = max(1 / BUSY_RATE_HZ, (time.monotonic() - began_s) / SHOWN_SHARE)
        self._rests_until_s = began_s + rest_s

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

    def _run(self, opened: "_Opened") -> None:
        while not opened.ended:
            with self._wake:
                if not self._listeners:
                    self._wake.wait(0.2)
                    continue
            started_s = time.monotonic()
            try:
                frame = self._grab(opened)
                if frame is not None:
                    self.show(frame)
            except Exception as error:
                if not isinstance(error, DeviceError):
                    _log.exception("the live picture")
                self._fail(opened, error)
                return
            time.sleep(max(0.001, 1 / self._rate() - (time.monotonic() - started_s)))

    def _rate(self) -> float:
        now_s = time.monotonic()
        if now_s - self._asked_s > ASK_EVERY_S:
            self._asked_s = now_s
            self._rate_hz = BUSY_RATE_HZ if self._busy() else LONGEST_RATE_HZ
        return self._rate_hz

    def _grab(self, opened: "_Opened") -> Frame | None:
        with opened.use:
            if opened.ended:
                return None
            try:
                return opened.camera.grab()
            except FrameError:
                return None  # The next frame is as good for the eyes.

    def _fail(self, opener: object, error: Exception) -> None:
        """Note that a camera failed, unless another one has taken its place."""
        with self._guard:
            if self._opener is not opener or not CAMERA.allows(self._status.state, CameraEvent.lose):
                return
            if self._opened is not None:
                self._opened.ended = True
            state = CAMERA.after(self._status.state, CameraEvent.lose)
            self._status = CameraStatus(state, self._status.experiment, reason=str(error), view=self.view)
        self._tell_state()

    def _tell_state(self) -> None:
        """Tell the state when it is another one than was told last."""
        with self._guard:
            news = (self._status.state, self._status.reason)
            if news == self._told:
                return
            self._told = news
        body = {"device": "camera", "view": self.view, "state": news[0].value, "reason": news[1]}
        self._tell("device", body)

    def _status_of(self, camera: Camera, experiment: str | None) -> CameraStatus:
        info = camera.info
        return CameraStatus(
            CameraState.ready,
            experiment,
            info.name,
            info.width_px,
            info.height_px,
            info.bits,
            info.frame_rate_hz,
            camera.exposure_s,
            camera.gain,
            view=self.view,
        )
