import cv2
import numpy as np
import pytest

from drivers.errors import DeviceNotFoundError, DeviceSettingError
from drivers.opencv_camera import OpenCvCamera
from drivers.protocols import Camera
from tests.drivers.scenes import pattern


@pytest.fixture
def folder(tmp_path):
    for number in range(6):
        grey = (pattern(seed=number) * 255).clip(0, 255).astype(np.uint8)
        cv2.imwrite(str(tmp_path / f"frame_{number:03d}.png"), grey)
    return tmp_path


def test_frames_of_a_file_come_in_order_and_unchanged(folder):
    with OpenCvCamera(str(folder / "frame_%03d.png"), live=False) as camera:
        assert isinstance(camera, Camera)
        for number in range(1, 6):  # the first one was read to learn the size
            sent = cv2.imread(str(folder / f"frame_{number:03d}.png"), cv2.IMREAD_GRAYSCALE)
            assert np.array_equal(camera.follow().pixels, sent)
        with pytest.raises(DeviceNotFoundError, match="ended"):
            camera.follow()
        camera.reconnect()
        assert camera.grab().sequence == 1


def test_what_it_cannot_do_is_said(folder):
    with OpenCvCamera(str(folder / "frame_%03d.png"), live=False) as camera:
        assert camera.exposure_s is None
        with pytest.raises(DeviceSettingError, match="own program"):
            camera.exposure_s = 0.01
    with pytest.raises(DeviceNotFoundError, match="no picture"):
        OpenCvCamera(str(folder / "absent_%03d.png"))
