"""The live camera: newest wins, one user at a time, and an unplugged camera is told, not hidden."""

import contextlib
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from app.rig.frame_statistics import jpeg_of, statistics_of
from app.rig.live_camera import CameraState, LiveCamera
from drivers.errors import DeviceBusyError, DeviceNotFoundError, DeviceSettingError
from drivers.protocols import CameraInfo, Frame
from drivers.simulated import CameraFault, SimulatedCamera

SCENE = np.tile(np.linspace(0.0, 0.9, 160, dtype=np.float32), (120, 1))


def frame_of(counts: np.ndarray) -> Frame:
    return Frame(counts.astype(np.uint16), 0, 0.0, 4095)


def test_statistics_are_fractions_of_full_scale():
    counts = np.zeros((64, 64))
    counts[:, 32:] = 4095
    seen = statistics_of(frame_of(counts))
    assert (seen.mean, seen.saturated, seen.dark) == (0.5, 0.5, 0.5)
    assert (seen.histogram[0], seen.histogram[-1], sum(seen.histogram)) == (512, 512, 1024)


def test_sharpness_grows_towards_focus():
    sharp = np.random.default_rng(0).uniform(500, 3500, (128, 128))
    blurred = (sharp + np.roll(sharp, 1, 0) + np.roll(sharp, 1, 1) + np.roll(sharp, (1, 1), (0, 1))) / 4
    assert statistics_of(frame_of(sharp)).sharpness_nd > 1.5 * statistics_of(frame_of(blurred)).sharpness_nd


def test_the_stretch_is_for_the_eyes_only():
    frame = frame_of(np.tile(np.linspace(1000, 1200, 64), (64, 1)))
    before = frame.pixels.copy()
    assert len(jpeg_of(frame, stretch=True)) > len(jpeg_of(frame, stretch=False))
    assert np.array_equal(frame.pixels, before)


def until(condition: Callable[[], bool], limit_s: float = 100.0) -> None:
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "it did not come to pass in time"
        time.sleep(0.02)


def opened(told: list, **options) -> LiveCamera:
    camera = LiveCamera(lambda kind, body: told.append((kind, body["state"])))
    camera.open("room", lambda: SimulatedCamera(lambda: SCENE, seed=1, **options))
    return camera


def test_of_a_capture_s_frames_as_many_are_shown_as_leave_it_time():
    camera, seen = opened([]), []
    frame = frame_of(np.zeros((8, 8)))
    with camera.using():
        camera.watch(1, lambda shown: (seen.append(time.monotonic()), time.sleep(0.05)))
        began_s = time.monotonic()
        while time.monotonic() < began_s + 1.0:
            camera.show(frame)
            time.sleep(0.001)
        newest = camera.newest
        camera.leave(1)
    camera.close()
    # A fifth of the time at most; the newest is always known.
    assert 1 <= len(seen) <= 5
    assert min(np.diff(seen), default=1.0) >= 0.25 - 0.01
    assert newest is frame


def test_watchers_see_frames_and_the_camera_rests_without_them():
    camera, seen = opened([]), []
    arrived = threading.Event()
    camera.watch(1, lambda frame: (seen.append(frame.number), arrived.set()))
    assert arrived.wait(60)
    camera.leave(1)
    # A frame that was on its way may still come; then no more do.
    until(lambda: len(seen) == (time.sleep(0.3), len(seen))[1])
    assert seen == sorted(seen)
    camera.close()
    assert camera.status.state is CameraState.closed


def test_settings_are_read_back():
    camera = opened([])
    assert camera.set(exposure_s=0.01, gain=2.0).exposure_s == 0.01
    assert camera.status.gain == 2.0
    with pytest.raises(DeviceSettingError, match="expected 1 to 16"):
        camera.set(exposure_s=None, gain=100.0)
    assert (camera.status.state, camera.status.gain) == (CameraState.ready, 2.0)
    camera.close()


def test_one_capture_at_a_time():
    camera = opened([])
    with camera.using() as _, pytest.raises(DeviceBusyError), camera.using():
        pass
    assert camera.status.state is CameraState.ready
    camera.close()
    with pytest.raises(DeviceNotFoundError), camera.using():
        pass


def test_an_unplugged_camera_is_told_with_what_to_do():
    told: list = []
    camera = opened(told, faults=lambda n: CameraFault.UNPLUG if n == 3 else None)
    camera.watch(1, lambda frame: None)
    until(lambda: camera.status.state is CameraState.failed)
    assert "unplugged" in camera.status.reason
    assert told[-1] == ("device", "failed")
    camera.open("room", lambda: SimulatedCamera(lambda: SCENE, seed=1))
    assert camera.status.state is CameraState.ready
    camera.close()


class Silent(SimulatedCamera):
    """A camera that tells nothing once it is unplugged, as the kernel's do."""

    @property
    def info(self) -> CameraInfo:
        if self._gone:
            raise DeviceNotFoundError("It was unplugged.")
        return super().info


def test_a_camera_that_is_lost_in_a_burst_is_not_ready_for_the_next_one():
    camera = LiveCamera(lambda kind, body: None)
    camera.open(
        "room", lambda: Silent(lambda: SCENE, seed=1, faults=lambda n: CameraFault.UNPLUG if n else None)
    )
    # The burst is incomplete, and says so itself: nothing is raised.
    with camera.using() as inner, contextlib.suppress(DeviceNotFoundError):
        inner.grab()
        inner.follow()
    assert camera.status.state is CameraState.failed
    assert "unplugged" in camera.status.reason
    camera.open("room", lambda: SimulatedCamera(lambda: SCENE, seed=1))
    assert camera.status.state is CameraState.ready
    camera.close()


def test_the_picture_is_shown_less_often_while_the_machine_computes():
    shown_s: list[float] = []
    for busy in (False, True):
        live = LiveCamera(lambda kind, body: None, busy=lambda busy=busy: busy)
        live.open("test", lambda: SimulatedCamera(lambda: SCENE, seed=1))
        shown_s.clear()
        began_s = time.monotonic()
        live.watch(1, lambda frame: shown_s.append(time.monotonic()))
        if busy:
            until(lambda: len(shown_s) >= 8)
        else:
            until(lambda: len(shown_s) > 1 and min(np.diff(shown_s)) < 0.09)
        live.close()
    # However long that took: not more than ten a second.
    assert len(shown_s) <= 10 * (time.monotonic() - began_s) + 2


def test_what_the_operator_set_survives_a_reconnect_until_the_experiment_names_another():
    camera = LiveCamera(lambda kind, body: None)

    def made(exposure_s: float) -> SimulatedCamera:
        return SimulatedCamera(lambda: SCENE, seed=1, exposure_s=exposure_s)

    camera.open("room", lambda: made(0.02))
    camera.set(exposure_s=0.012, gain=None)
    camera.set(exposure_s=None, gain=3.0)
    camera.open("other", lambda: made(0.02))
    assert (camera.status.exposure_s, camera.status.gain) == (0.02, 1.0)
    camera.open("room", lambda: made(0.02), "moving")
    assert (camera.status.exposure_s, camera.status.gain, camera.status.reason) == (0.012, 3.0, "")
    camera.open("room", lambda: made(0.03))
    assert (camera.status.exposure_s, camera.status.gain) == (0.03, 1.0)
    camera.close()


def test_a_reconnect_says_which_settings_are_refused_now():
    camera = LiveCamera(lambda kind, body: None)
    camera.open("room", lambda: SimulatedCamera(lambda: SCENE, seed=1))
    camera.set(exposure_s=None, gain=3.0)

    class NoGain(SimulatedCamera):
        @property
        def gain(self) -> float:
            return 1.0

        @gain.setter
        def gain(self, value: float) -> None:
            raise DeviceSettingError("There is no gain control.")

    camera.open("room", lambda: NoGain(lambda: SCENE, seed=1))
    assert camera.status.state is CameraState.ready
    assert "chosen before are not in use. There is no gain control." in camera.status.reason
    camera.close()
