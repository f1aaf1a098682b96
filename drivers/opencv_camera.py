"""OpenCV's VideoCapture, for what is no V4L2 camera: a stream, a file, another system's webcam.

A second choice: it gives no sequence numbers and no error flags, so that a lost frame shows only in the
times between arrivals, and exposure and gain are not to be had. Use `drivers.v4l2` where there is a node.
"""

import time

import cv2
import numpy as np

from drivers.errors import DeviceNotFoundError, DeviceSettingError
from drivers.gate import Arrival, FrameGate
from drivers.protocols import CameraInfo, Frame

QUEUED_AT_MOST = 8


class OpenCvCamera:
    """A camera by number, address or file name. `live`: frames queue up, and old ones are passed over."""

    def __init__(self, source: int | str, *, live: bool = True) -> None:
        self._source, self._live = source, live
        self._open()

    @property
    def info(self) -> CameraInfo:
        """Identity and size of the first frame; 8 bit, since no more comes through."""
        rows, cols = self._shape
        return CameraInfo(str(self._source), cols, rows, 8, 1 / self._period_s)

    @property
    def exposure_s(self) -> float | None:
        """None: not to be had here."""
        return None

    @exposure_s.setter
    def exposure_s(self, value: float) -> None:
        raise DeviceSettingError("Exposure cannot be set reliably here. Set it in the camera's own program.")

    @property
    def gain(self) -> float | None:
        """None: not to be had here."""
        return None

    @gain.setter
    def gain(self, value: float) -> None:
        raise DeviceSettingError("Gain cannot be set reliably here. Set it in the camera's own program.")

    def grab(self) -> Frame:
        """Return the next new frame: one that had to be waited for did not lie in the queue."""
        for _ in range(QUEUED_AT_MOST if self._live else 0):
            asked_s = time.monotonic()
            self._advance()
            if time.monotonic() - asked_s > 0.5 * self._period_s:
                break
        self._gate.restart()
        return self.follow()

    def follow(self) -> Frame:
        """Return the next frame. Raises FrameError when the time since the last one tells of a loss."""
        self._advance()
        done, picture = self._capture.retrieve()
        now_s = time.monotonic() if self._live else self._count * self._period_s
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if done and picture.ndim == 3 else picture
        good = done and grey.shape == self._shape and grey.dtype == np.uint8
        size = grey.size if good else 0
        self._gate.admit(Arrival(self._count, now_s, not good, size), consecutive=True)
        return Frame(np.asarray(grey, np.uint8), self._count, now_s, 255)

    def reconnect(self) -> None:
        """Open the source again."""
        self.close()
        self._open()

    def close(self) -> None:
        """Free the source."""
        self._capture.release()

    def __enter__(self) -> "OpenCvCamera":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _open(self) -> None:
        self._capture = cv2.VideoCapture(self._source)
        done, picture = self._capture.read()
        if not done:
            self._capture.release()
            raise DeviceNotFoundError(f"{self._source!r} gives no picture. Check its name and users.")
        self._shape = (int(picture.shape[0]), int(picture.shape[1]))
        rate_hz = self._capture.get(cv2.CAP_PROP_FPS)
        self._period_s = 1 / rate_hz if 0.1 < rate_hz < 1000 else 1 / 30
        self._count = 0
        self._gate = FrameGate(self._shape[0] * self._shape[1], self._period_s, late_factor=2.5)

    def _advance(self) -> None:
        # isOpened() stays true after an unplug: a failed grab is the only sign of it.
        if not self._capture.grab():
            raise DeviceNotFoundError(f"{self._source!r} ended or was unplugged. Plug it in, then reconnect.")
        self._count += 1
