import cv2
import numpy as np
import pytest

from drivers.display import PatternDisplay
from drivers.errors import DeviceSettingError
from drivers.pattern_check import check_pattern
from drivers.simulated import SimulatedCamera
from drivers.simulated.display import SimulatedDisplay
from tests.drivers.scenes import pattern

CAMERA_FROM_PICTURE = np.array([[0.9, 0.02, 30.0], [-0.01, 0.9, 20.0], [1e-5, 1e-5, 1.0]])


def make_rig(display):
    def look():
        seen = cv2.warpPerspective(display.picture.astype(np.float32), CAMERA_FROM_PICTURE, (560, 420))
        return (seen * np.float32(0.7 / 255) + np.float32(0.05)).astype(np.float32)

    return SimulatedCamera(look, seed=1)


def picture(seed=0):
    return cv2.GaussianBlur(
        (pattern(400, 500, contrast=0.5, seed=seed) * 255).clip(0, 255), (0, 0), 2
    ).astype(np.uint8)


def test_the_camera_confirms_what_is_shown_and_the_pattern_stays():
    display = SimulatedDisplay(400, 500)
    assert isinstance(display, PatternDisplay)
    assert check_pattern(display, make_rig(display), picture()).good
    assert np.array_equal(display.picture, picture())


def test_another_window_over_the_pattern_is_seen_by_the_camera():
    display = SimulatedDisplay(400, 500)
    camera = make_rig(display)
    show, other = display.show, picture(seed=1)

    def cheat(shown):
        digest = show(shown)
        if np.array_equal(shown, picture()):
            display.swap(other)
        return digest

    display.show = cheat
    assert not check_pattern(display, camera, picture()).good


def test_a_screen_of_another_size_or_out_of_view_is_refused():
    display = SimulatedDisplay(300, 500)
    with pytest.raises(DeviceSettingError, match="500 x 300"):
        check_pattern(display, make_rig(display), picture())
    display = SimulatedDisplay(400, 500)
    elsewhere = SimulatedDisplay(400, 500)
    with pytest.raises(DeviceSettingError, match="does not see"):
        check_pattern(display, make_rig(elsewhere), picture())
