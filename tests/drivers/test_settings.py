from pathlib import Path

import numpy as np
import pytest

from drivers.aravis import AravisCamera, AravisRequest
from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.errors import DeviceSettingError
from drivers.settings import bits_of, grab_settled, held
from drivers.simulated import CameraFault, SimulatedCamera
from drivers.v4l2 import V4l2Camera, V4l2Request
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
    camera = make_camera(faults=lambda n: CameraFault.UNPLUG if n == 20 else None)
    burst = run_capture(camera, CapturePlan(frames=50, exposure_s=0.02))
    assert 0 < burst.frames < 20
    assert burst.outcome == "device lost"


@pytest.mark.parametrize("held_before", [False, True])
def test_no_frame_of_a_burst_has_the_exposure_of_before(held_before):
    camera = make_camera(exposure_s=0.01)
    run_capture(camera, CapturePlan(frames=3))
    before = camera.grab().pixels.mean() - 64
    plan = CapturePlan(frames=20, exposure_s=None if held_before else 0.015)
    with held(camera, 0.015 if held_before else None):
        burst = run_capture(camera, plan)
    # Less the dark level, which no exposure changes; a frame of the old exposure is at two thirds.
    levels = np.array([record.level for record in burst.records]) * 4095 - 64
    np.testing.assert_allclose(levels, 1.5 * before, rtol=0.01)
    back = run_capture(camera, CapturePlan(frames=20))
    np.testing.assert_allclose([record.level * 4095 - 64 for record in back.records], before, rtol=0.01)
    assert not burst.refused


def test_one_frame_is_waited_for_until_a_change_has_acted():
    camera = make_camera(exposure_s=0.01)
    before = camera.grab().pixels.mean() - 64
    with held(camera, gain=1.5):
        assert camera.grab().pixels.mean() - 64 == pytest.approx(before, rel=0.01)
        assert grab_settled(camera).pixels.mean() - 64 == pytest.approx(1.5 * before, rel=0.01)


def test_an_exposure_longer_than_the_frame_period_stretches_it_and_loses_no_frame():
    camera = make_camera(exposure_s=1 / 60)
    for periods in (1, 2, 3, 4, 1):
        burst = run_capture(camera, CapturePlan(frames=8, exposure_s=periods / 60))
        assert burst.frames == 8
        assert not burst.refused


def test_bits_are_the_format_s_unless_fewer_are_stated_and_more_are_refused_before_a_camera_is_opened():
    assert bits_of(None, "GREY", 8) == 8
    assert bits_of(12, "Y16", 16) == 12
    with pytest.raises(DeviceSettingError, match="GREY holds 8 bits; asked were 16"):
        V4l2Camera(V4l2Request(Path("/dev/video0"), 640, 480, pixel_format="GREY", bits=16))
    with pytest.raises(DeviceSettingError, match="Mono12 holds 12 bits"):
        AravisCamera(AravisRequest("none", 64, 64, pixel_format="Mono12", bits=14))
