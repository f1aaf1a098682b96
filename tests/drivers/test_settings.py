import pytest

from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.errors import DeviceSettingError
from drivers.settings import held
from drivers.simulated import CameraFault, SimulatedCamera
from tests.drivers.scenes import pattern


def make_camera(**options) -> SimulatedCamera:
    view = pattern()
    return SimulatedCamera(lambda: view, seed=1, **options)


def test_a_burst_s_own_settings_hold_for_the_burst_alone():
    camera = make_camera(exposure_s=0.01)
    burst = run_capture(camera, CapturePlan(frames=3, exposure_s=0.02, gain=2.0))
    assert [one.granted for one in burst.settings] == [0.02, 2.0]
    assert (camera.exposure_s, camera.gain) == (0.01, 1.0)


def test_what_was_there_comes_back_after_a_refusal_and_after_an_error():
    camera = make_camera(exposure_s=0.01)
    with pytest.raises(DeviceSettingError), held(camera, 0.02, 100.0):
        pass
    assert (camera.exposure_s, camera.gain) == (0.01, 1.0)
    with pytest.raises(ValueError, match="full"), held(camera, 0.02):
        raise ValueError("full")
    assert camera.exposure_s == 0.01


def test_what_is_not_given_is_not_touched():
    camera = make_camera(exposure_s=0.01)
    with held(camera) as settings:
        camera.exposure_s = 0.03
    assert camera.exposure_s == 0.03
    assert [one.asked for one in settings] == [None, None]


def test_a_camera_that_is_lost_in_a_burst_with_settings_keeps_its_frames():
    camera = make_camera(faults=lambda n: CameraFault.UNPLUG if n == 9 else None)
    burst = run_capture(camera, CapturePlan(frames=50, exposure_s=0.02))
    assert 0 < burst.frames < 9
    assert burst.outcome == "device lost"
