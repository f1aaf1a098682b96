import cv2
import numpy as np
import pytest

from drivers.errors import DeviceSettingError
from drivers.identify import identify_frame, judge_seen, locate
from tests.drivers.scenes import pattern

CAMERA_FROM_PICTURE = np.array([[0.8, 0.03, 60.0], [-0.02, 0.82, 40.0], [1e-5, 2e-5, 1.0]])


def see(picture, noise=2.0, flip=False):
    """Return what a camera of 800 x 640 sees of a picture, at an angle, dimmed and noisy."""
    picture = picture[:, ::-1].copy() if flip else picture
    seen = cv2.warpPerspective(picture.astype(np.float32), CAMERA_FROM_PICTURE, (800, 640)) * 8 + 100
    counts = (seen + np.random.default_rng(0).normal(size=seen.shape) * noise * 8).clip(0).astype(np.uint16)
    counts[[50, 20, 600], [700, 20, 90]] = 65535  # hot pixels
    return counts


def test_the_corners_give_the_way_from_picture_to_camera():
    found = locate(see(identify_frame(600, 800)), 600, 800)
    points = np.array([[[100.0, 100.0]], [[700.0, 500.0]]])
    true, got = (cv2.perspectiveTransform(points, h) for h in (CAMERA_FROM_PICTURE, found))
    # Marker corners are found to about a third of a pixel.
    assert np.abs(true - got).max() < 0.5


def test_another_picture_than_the_sent_one_is_noticed():
    sent = (pattern(600, 800, contrast=0.5) * 255).clip(0, 255).astype(np.uint8)
    other = (pattern(600, 800, contrast=0.5, seed=1) * 255).clip(0, 255).astype(np.uint8)
    sent, other = (cv2.GaussianBlur(p, (0, 0), 2.0) for p in (sent, other))
    assert judge_seen(see(sent), sent, CAMERA_FROM_PICTURE).good
    assert not judge_seen(see(other), sent, CAMERA_FROM_PICTURE).good


def test_a_mirrored_or_hidden_frame_is_said_with_its_corners():
    with pytest.raises(DeviceSettingError, match="mirrored"):
        locate(see(identify_frame(600, 800), flip=True), 600, 800)
    half = see(identify_frame(600, 800))
    half[:, 400:] = 100
    with pytest.raises(DeviceSettingError, match="top right, bottom right"):
        locate(half, 600, 800)
    with pytest.raises(DeviceSettingError, match="at least 120"):
        identify_frame(90, 800)
