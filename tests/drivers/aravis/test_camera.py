"""GigE Vision against Aravis's own fake camera, whose pictures hold their number."""

import contextlib
import time
from dataclasses import replace

import numpy as np
import pytest

from drivers.aravis import AravisCamera, AravisRequest, list_aravis
from drivers.errors import (
    DeviceError,
    DeviceNotFoundError,
    DeviceSettingError,
    DeviceTimeoutError,
    FrameError,
    FrameFault,
)
from tests.drivers.aravis.fake import ADDRESS, REQUEST, fake_camera, missing, no_camera, opened

pytestmark = missing


def followed(camera: AravisCamera, frames: int) -> list:
    """So many good frames, as a burst takes them: what is refused is counted by the gate."""
    found = []
    while len(found) < frames:
        with contextlib.suppress(FrameError):
            found.append(camera.follow() if found else camera.grab())
    return found


def first_frame(camera: AravisCamera, within_s: float = 20.0):
    """A frame, waited for: beside other tests the fake camera may not send its first one within a second."""
    until_s = time.monotonic() + within_s
    while True:
        try:
            return camera.grab()
        except DeviceTimeoutError:
            assert time.monotonic() < until_s


def numbers_in(frames) -> np.ndarray:
    """What each picture says of its own number: the fake draws a ramp that moves by one count a frame."""
    corners = np.array([int(frame.pixels[0, 0]) for frame in frames])
    return np.cumsum(np.diff(corners) % 255)


def test_a_thousand_frames_and_none_is_lost_unseen():
    with fake_camera(), opened() as camera:
        frames = followed(camera, 1000)
        lost = sum(camera.gate.refused.values()) - camera.gate.refused[FrameFault.STALE]
    sequence = np.array([frame.sequence for frame in frames])
    print(f"1000 frames, {lost} lost and told: {dict(camera.gate.refused)}")
    assert (np.diff(sequence) > 0).all()
    assert sequence[-1] - sequence[0] + 1 == 1000 + lost
    # The pictures themselves agree with the numbers.
    np.testing.assert_array_equal(numbers_in(frames), sequence[1:] - sequence[0])


def test_lost_packets_never_reach_a_picture():
    with fake_camera("-r", "20"), opened() as camera:
        frames = followed(camera, 100)
    first = frames[0].pixels.astype(int)
    for frame in frames:
        moved = (frame.pixels.astype(int) - first) % 255
        assert (moved == moved[0, 0]).all()


def test_settings_are_read_back_and_a_size_that_is_not_granted_is_refused():
    with fake_camera(), opened() as camera:
        assert camera.exposure_s == pytest.approx(0.01)
        assert camera.info.frame_rate_hz == pytest.approx(100, rel=0.01)
        camera.gain = 3.0
        assert camera.gain == pytest.approx(3.0)
        with pytest.raises(DeviceSettingError, match=r"refused|asked was"):
            camera.exposure_s = 1e6
        camera.close()
        with pytest.raises(DeviceSettingError, match=r"refused|asked were"):
            AravisCamera(replace(REQUEST, width_px=100_000))
    with pytest.raises(DeviceSettingError, match="Mono16, Mono14"):
        AravisCamera(AravisRequest(ADDRESS, 64, 64, pixel_format="RGB8"))


def test_an_unplugged_camera_is_missed_at_once_and_found_again():
    with fake_camera() as process:
        camera = opened()
        first_frame(camera)
        process.kill()
        process.wait()
        began_s = time.monotonic()
        with pytest.raises(DeviceNotFoundError, match="is gone"):
            followed(camera, 1000)
        assert time.monotonic() - began_s < 20
        with pytest.raises(DeviceNotFoundError, match="Plug it in"):
            camera.reconnect()
    with fake_camera():
        until_s = time.monotonic() + 30
        while True:
            try:
                camera.reconnect()
                break
            except DeviceError:
                assert time.monotonic() < until_s
        assert first_frame(camera).pixels.shape == (128, 256)
        camera.close()
        camera.close()


def test_it_is_listed_with_its_formats():
    with fake_camera("-s", "LAB7"):
        opened().close()
        (found,) = [one for one in list_aravis() if one.address == ADDRESS]
        assert (found.width_px, found.height_px) == (2048, 2048)
        assert found.formats == ("Mono16", "Mono8")
        assert "LAB7" in found.device
        with opened(replace(REQUEST, device=found.device, pixel_format="Mono16")) as camera:
            frame = camera.grab()
        assert frame.pixels.dtype == np.uint16
        assert frame.full_scale_counts == 65535


def test_a_camera_that_is_away_is_said_to_be():
    with (
        no_camera(),
        pytest.raises(DeviceNotFoundError, match="There is no GigE Vision or USB3 Vision camera"),
    ):
        AravisCamera(REQUEST)
