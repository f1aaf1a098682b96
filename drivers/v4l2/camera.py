"""A V4L2 camera: what was asked is what was granted, and every frame passes the gate.

Formats that the driver would substitute are refused; automatics are switched off and verified; frames are
fresh by their timestamp; an unplug is noticed and `reconnect` finds the camera again, also on another node.
"""

import time
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import DeviceNotFoundError, DeviceSettingError
from drivers.gate import Arrival, FrameGate
from drivers.protocols import CameraInfo, Frame
from drivers.settings import bits_of
from drivers.v4l2 import abi
from drivers.v4l2.controls import Controls
from drivers.v4l2.formats import pixel_format
from drivers.v4l2.inventory import as_text, captures, list_devices, query
from drivers.v4l2.negotiation import negotiate_format, negotiate_period_s
from drivers.v4l2.node import Node
from drivers.v4l2.stream import Filled, Stream


@dataclass(frozen=True)
class V4l2Request:
    """What is asked of a camera. `frame_rate_hz`, `exposure_s` and `gain` stay as they are when None.

    `bits` are the significant ones where a camera puts fewer into a wider format (12 in Y16); None: the format's.
    """

    device: Path
    width_px: int
    height_px: int
    pixel_format: str = "Y16"
    frame_rate_hz: float | None = None
    exposure_s: float | None = None
    gain: float | None = None
    bits: int | None = None
    automatics_off: bool = True


class V4l2Camera:
    """An open camera that streams. A context manager."""

    def __init__(self, request: V4l2Request) -> None:
        self._request = request
        self._format = pixel_format(request.pixel_format)
        self._bits = bits_of(request.bits, request.pixel_format, self._format.bits)
        self._identity: tuple[bytes, bytes] | None = None
        self._node: Node | None = None
        self._stream: Stream | None = None
        self._open(request.device)

    @property
    def info(self) -> CameraInfo:
        """Identity, size and settings as the driver has them now."""
        name = as_text(self._identity[0]) if self._identity else ""
        settings: dict[str, float | int | str] = dict(self._controls.values())
        settings["pixel_format"] = self._format.code
        period_s = self._gate.period_s
        rate_hz = None if period_s is None else 1 / period_s
        return CameraInfo(name, self._geometry.cols, self._geometry.rows, self._bits, rate_hz, settings)

    @property
    def controls(self) -> Controls:
        """Every control by name."""
        return self._controls

    @property
    def gate(self) -> FrameGate:
        """The gate, with its counts of refused frames."""
        return self._gate

    @property
    def exposure_s(self) -> float | None:
        """Exposure time as the driver has it; None when it has no such control."""
        if not self._controls.has(abi.CID_EXPOSURE_ABSOLUTE):
            return None
        return self._controls.get(abi.CID_EXPOSURE_ABSOLUTE) * abi.EXPOSURE_UNIT_S

    @exposure_s.setter
    def exposure_s(self, value: float) -> None:
        if not self._controls.has(abi.CID_EXPOSURE_ABSOLUTE):
            raise DeviceSettingError(
                f"{self._request.device} has no exposure control. Leave exposure_s out of the plan."
            )
        before_s = self.exposure_s
        self._controls.set(abi.CID_EXPOSURE_ABSOLUTE, round(value / abi.EXPOSURE_UNIT_S))
        if self.exposure_s != before_s:
            self._gate.note_change(self.exposure_s)

    @property
    def gain(self) -> float | None:
        """Gain in the driver's own unit; None when it has no such control."""
        found = self._gain_control()
        return None if found is None else float(self._controls.get(found))

    @gain.setter
    def gain(self, value: float) -> None:
        found = self._gain_control()
        if found is None:
            raise DeviceSettingError(
                f"{self._request.device} has no gain control. Leave gain out of the plan."
            )
        before = self.gain
        self._controls.set(found, round(value))
        if self.gain != before:
            self._gate.note_change(self.exposure_s)

    def grab(self) -> Frame:
        """Return the next frame whose exposure begins after this call."""
        called_s = time.monotonic()
        while True:
            filled = self._dequeue()
            if not filled.monotonic:
                self._running().restart()  # its age cannot be known: only a new stream is surely fresh
                self._gate.restart()
                filled = self._dequeue()
                return self._pass(filled, self._arrival(filled), consecutive=False)
            arrival = self._arrival(filled)
            if not self._gate.is_stale(arrival, called_s):
                return self._pass(filled, arrival, consecutive=False)

    def follow(self) -> Frame:
        """Return the frame that comes directly after the last one."""
        filled = self._dequeue()
        return self._pass(filled, self._arrival(filled), consecutive=True)

    def reconnect(self) -> None:
        """Open the same camera again, by node or, when that changed, by name and bus."""
        identity = self._identity
        self.close()
        candidates = [self._request.device, *(found.path for found in list_devices() if not found.error)]
        for path in dict.fromkeys(candidates):
            try:
                self._open(path, identity)
                return
            except DeviceNotFoundError:
                self.close()
        raise DeviceNotFoundError(
            f"{as_text((identity or (b'The camera', b''))[0])} is not back yet. "
            "Plug it in; `airlens devices` lists what is there."
        )

    def close(self) -> None:
        """Stop and free the device."""
        if self._stream is not None:
            self._stream.close()
        if self._node is not None:
            self._node.close()
        self._stream = self._node = None

    def __enter__(self) -> "V4l2Camera":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _open(self, path: Path, expected: tuple[bytes, bytes] | None = None) -> None:
        self._node = Node(path)
        try:
            about = query(self._node)
            if not captures(about) or expected not in (None, (about.card, about.bus_info)):
                raise DeviceNotFoundError(f"{path} is not the camera that was asked for.")
            self._identity = about.card, about.bus_info
            wanted = self._request
            self._geometry = negotiate_format(
                self._node, wanted.pixel_format, wanted.width_px, wanted.height_px
            )
            self._driver = about.driver
            period_s = negotiate_period_s(self._node, wanted.frame_rate_hz)
            self._controls = Controls(self._node)
            self._gate = FrameGate(self._format.bytes_needed(self._geometry), period_s)
            self._apply_settings()
            self._stream = Stream(self._node, self._geometry.size_bytes)
        except BaseException:
            self.close()
            raise

    def _apply_settings(self) -> None:
        if self._request.automatics_off:
            self._controls.switch_automatics_off()
        if self._request.exposure_s is not None:
            self.exposure_s = self._request.exposure_s
        if self._request.gain is not None:
            self.gain = self._request.gain
        self._gate.note_change(self.exposure_s)

    def _gain_control(self) -> int | None:
        known = (abi.CID_GAIN, abi.CID_ANALOGUE_GAIN)
        return next((identifier for identifier in known if self._controls.has(identifier)), None)

    def _running(self) -> Stream:
        if self._stream is None:
            raise DeviceNotFoundError(f"{self._request.device} is closed. Open it again with `reconnect`.")
        return self._stream

    def _dequeue(self) -> Filled:
        return self._running().dequeue(self._gate.patience_s)

    def _arrival(self, filled: Filled) -> Arrival:
        length_s = self.exposure_s or self._gate.period_s or 0.0
        return Arrival(
            filled.sequence,
            exposed_s(filled, length_s, self._driver),
            bool(filled.flags & abi.BUF_FLAG_ERROR),
            filled.data.size,
        )

    def _pass(self, filled: Filled, arrival: Arrival, *, consecutive: bool) -> Frame:
        self._gate.admit(arrival, consecutive=consecutive)
        pixels = self._format.decode(filled.data, self._geometry)
        full_scale = 2**self._bits - 1
        return Frame(pixels, filled.sequence, filled.timestamp_s, full_scale, self._gate.since_change)


def exposed_s(filled: Filled, length_s: float, driver: bytes) -> float:
    """Return when the exposure of a buffer began, that took `length_s`; at the earliest where the stamp is unsure.

    uvcvideo always says "start of exposure", and unless it is told otherwise stamps a frame when its first bytes
    arrive: after its exposure.
    """
    return filled.timestamp_s - (0.0 if filled.at_start and driver != b"uvcvideo" else length_s)
