import numpy as np
import pytest

from drivers.errors import DeviceNotFoundError, DeviceTimeoutError, FrameError, FrameFault
from drivers.protocols import Camera
from drivers.settings import grab_settled
from drivers.shift import shift_image
from drivers.simulated import CameraFault, SensorNoise, SimulatedCamera, VirtualClock
from tests.drivers.scenes import pattern


def frames(camera, count):
    return np.stack([camera.follow().pixels.astype(float) for _ in range(count)])


@pytest.mark.parametrize("luminance", [0.0, 0.001, 0.004, 0.2, 0.8])
def test_mean_and_variance_follow_the_photon_transfer_curve(luminance):
    noise = SensorNoise(full_well_e=10_000.0, read_noise_e=3.0, dark_counts=64.0, bits=14)
    view = np.full((64, 64), luminance, np.float32)
    camera = SimulatedCamera(lambda: view, seed=3, noise=noise)

    stack = frames(camera, 40)

    k = (2**14 - 1 - 64) / 10_000
    electrons = 10_000 * luminance
    count = stack.size
    variance = k**2 * (electrons + 9) + 1 / 12  # rounding to whole counts
    # Five standard errors of each estimate.
    assert stack.mean() == pytest.approx(64 + k * electrons, abs=5 * (variance / count) ** 0.5)
    assert stack.var() == pytest.approx(variance, rel=5 * (2 / count) ** 0.5 * 1.2)


def test_the_same_seed_gives_the_same_frames_whatever_the_threads(monkeypatch):
    view = pattern(1024, 1024)
    one, other = (SimulatedCamera(lambda: view, seed=7) for _ in range(2))
    threaded = one.grab()

    monkeypatch.setattr("drivers.simulated.camera._THREADED_FROM_PX", 10**9)
    alone = other.grab().pixels

    assert np.array_equal(threaded.pixels, alone)
    assert not np.array_equal(one.follow().pixels, threaded.pixels)


def test_longer_exposure_and_gain_scale_the_signal_until_it_saturates():
    view = np.full((32, 32), 0.2, np.float32)
    camera = SimulatedCamera(lambda: view, seed=1, noise=SensorNoise(dark_counts=0.0))
    base = camera.grab().pixels.mean()

    camera.exposure_s *= 2
    doubled = grab_settled(camera).pixels.mean()
    camera.gain = 16.0

    assert doubled == pytest.approx(2 * base, rel=0.01)
    assert (grab_settled(camera).pixels == 4095).all()


def test_shift_moves_a_sinusoid_by_a_small_fraction_of_a_pixel():
    x = np.arange(256, dtype=np.float32)
    wave = np.tile(np.sin(2 * np.pi * x / 8), (64, 1)).astype(np.float32)
    moved = shift_image(wave, (0.013, 0.0))
    exact = np.sin(2 * np.pi * (x - 0.013) / 8)
    # A 16-tap windowed sinc passes a period of 8 px to 1e-4; a 1/32 px rounding would leave 1e-2.
    assert np.abs(moved[32, 32:-32] - exact[32:-32]).max() < 2e-4


def test_a_grab_after_a_pause_begins_after_the_call():
    clock, view = VirtualClock(), pattern()
    camera = SimulatedCamera(lambda: view, seed=1, clock=clock)
    camera.grab()
    clock.advance_s(2.01)
    called_s = clock.now_s()
    assert camera.grab().timestamp_s >= called_s


def test_a_reader_slower_than_the_buffers_is_told_what_it_lost():
    clock, view = VirtualClock(), pattern()
    camera = SimulatedCamera(lambda: view, seed=1, clock=clock)
    camera.follow()
    clock.advance_s(1.0)
    with pytest.raises(FrameError) as caught:
        camera.follow()
    assert caught.value.fault is FrameFault.DROPPED
    # 30 frames passed, four were still in the buffers.
    assert caught.value.lost == pytest.approx(26, abs=1)


@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        (CameraFault.DROP, FrameFault.DROPPED),
        (CameraFault.SILENT_DROP, FrameFault.LATE),
        (CameraFault.ERROR_FLAG, FrameFault.CORRUPT),
        (CameraFault.SHORT, FrameFault.CORRUPT),
        (CameraFault.OLD_BUFFER, FrameFault.STALE),
    ],
)
def test_each_bad_frame_is_refused_by_its_kind_and_the_next_is_good(fault, kind):
    view = pattern()
    camera = SimulatedCamera(lambda: view, seed=1, faults=lambda n: fault if n == 3 else None)
    for _ in range(3):
        camera.follow()
    with pytest.raises(FrameError) as caught:
        camera.follow()
    assert caught.value.fault is kind
    if fault is CameraFault.OLD_BUFFER:  # it came in the place of a frame that is lost for good
        with pytest.raises(FrameError, match="1 frame"):
            camera.follow()
    index = camera._next
    assert np.array_equal(camera.follow().pixels, camera.expected(index))


def test_stall_and_unplug_are_told_apart_and_reconnect_brings_it_back():
    script = iter([None, CameraFault.STALL, CameraFault.UNPLUG])
    view = pattern()
    camera = SimulatedCamera(lambda: view, seed=1, faults=lambda _: next(script, None))
    assert isinstance(camera, Camera)
    camera.grab()
    with pytest.raises(DeviceTimeoutError):
        camera.follow()
    for _ in range(2):
        with pytest.raises(DeviceNotFoundError):
            camera.grab()
    camera.reconnect()
    assert camera.grab().pixels.shape == view.shape
