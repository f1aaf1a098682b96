"""What every camera owes its user: the twin, Aravis's fake where it is installed, `--camera /dev/video0`."""

from pathlib import Path

import numpy as np
import pytest

from drivers.burst import BurstOutcome, CapturePlan
from drivers.capture import run_capture
from drivers.gate import CONTROL_FRAMES
from drivers.protocols import Camera
from drivers.simulated import SimulatedCamera
from drivers.v4l2 import V4l2Camera, V4l2Request, list_devices
from tests.drivers.aravis.fake import fake_camera, missing
from tests.drivers.aravis.fake import opened as opened_fake
from tests.drivers.scenes import pattern


def open_hardware(device):
    found = next(d for d in list_devices() if d.path == device)
    readable = {"Y16", "Y12", "Y10", "GREY", "YUYV", "MJPG"}
    chosen = next(f for f in found.formats if f.code in readable and f.sizes)
    size = chosen.sizes[0]
    return V4l2Camera(V4l2Request(device, size.width_px, size.height_px, pixel_format=chosen.code))


@pytest.fixture(
    params=[
        "twin",
        pytest.param("aravis", marks=missing),
        pytest.param("hardware", marks=pytest.mark.hardware),
    ]
)
def camera(request):
    if request.param == "aravis":
        with fake_camera(), opened_fake() as opened:
            yield opened
        return
    if request.param == "twin":
        view = pattern()
        opened = SimulatedCamera(lambda: view, seed=1)
    else:
        device = request.config.getoption("--camera")
        if device is None:
            pytest.skip("no --camera given")
        opened = open_hardware(Path(device))
    with opened:
        yield opened


def test_it_is_a_camera_and_says_what_it_is(camera):
    assert isinstance(camera, Camera)
    info = camera.info
    assert info.name
    assert 0 < info.bits <= 16
    assert info.frame_rate_hz > 0


def test_frames_have_the_stated_size_and_scale(camera):
    frame, info = camera.grab(), camera.info
    assert frame.pixels.shape == (info.height_px, info.width_px)
    assert frame.pixels.dtype == (np.uint8 if info.bits <= 8 else np.uint16)
    assert frame.full_scale_counts == 2**info.bits - 1
    assert frame.pixels.max() <= frame.full_scale_counts


def test_followed_frames_are_consecutive_and_grabbed_ones_are_new(camera):
    frames = [camera.grab(), camera.follow(), camera.follow()]
    assert np.diff([f.sequence for f in frames]).tolist() == [1, 1]
    assert (np.diff([f.timestamp_s for f in frames]) > 0).all()
    assert camera.grab().sequence > frames[-1].sequence


def test_frames_are_the_callers_own(camera):
    first = camera.grab()
    kept = first.pixels.copy()
    for _ in range(6):
        camera.follow()
    assert np.array_equal(first.pixels, kept)


def test_a_burst_is_whole(camera):
    burst = run_capture(camera, CapturePlan(frames=10))
    assert burst.outcome is BurstOutcome.COMPLETE
    assert burst.frames == 10


def test_frames_are_counted_from_a_change_of_exposure_on_and_a_burst_waits_for_it_to_act(camera):
    own_s = camera.exposure_s
    if own_s is None:
        pytest.skip("no exposure to change")
    camera.grab()
    camera.exposure_s = 2 * own_s
    frames = [camera.grab(), camera.follow(), camera.follow()]
    assert [frame.since_change for frame in frames] == [0, 1, 2]
    camera.exposure_s = 2 * own_s  # as it is: no change
    assert camera.follow().since_change == 3
    taken = []
    burst = run_capture(
        camera,
        CapturePlan(frames=4, exposure_s=own_s),
        on_frame=lambda one: taken.append(one.frame.since_change),
    )
    assert burst.outcome is BurstOutcome.COMPLETE
    assert min(taken) >= CONTROL_FRAMES


def test_it_can_be_closed_twice_and_opened_again(camera):
    camera.grab()
    camera.close()
    camera.close()
    camera.reconnect()
    assert camera.grab().pixels.size
