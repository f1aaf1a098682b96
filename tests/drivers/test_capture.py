import cv2
import numpy as np
import pytest

from drivers.burst import BurstOutcome, CapturePlan
from drivers.capture import run_capture
from drivers.errors import DeviceNotFoundError
from drivers.simulated import CameraFault, SensorNoise, SimulatedCamera
from tests.drivers.scenes import pattern


def make_camera(view=None, **options):
    view = pattern() if view is None else view
    return SimulatedCamera(lambda: view, seed=5, **options)


def verdict(burst, name):
    return next(v for v in burst.verdicts if v.name == name)


def test_moments_are_those_of_the_stack():
    stack = []
    burst = run_capture(
        make_camera(), CapturePlan(frames=12), on_frame=lambda taken: stack.append(taken.frame.pixels)
    )
    stack = np.stack(stack) / burst.full_scale_counts
    # float32 results of exact sums.
    np.testing.assert_allclose(burst.mean, stack.mean(0), rtol=1e-6)
    np.testing.assert_allclose(burst.std, stack.std(0, ddof=1), rtol=1e-5, atol=1e-8)
    assert burst.outcome is BurstOutcome.COMPLETE
    assert [r.sequence for r in burst.records] == list(range(burst.records[0].sequence, 14))


def test_bad_frames_are_counted_and_taken_again():
    faults = {5: CameraFault.DROP, 9: CameraFault.ERROR_FLAG, 11: CameraFault.SHORT, 15: CameraFault.STALL}
    camera = make_camera(faults=faults.get)
    stack = []
    burst = run_capture(camera, CapturePlan(frames=20), on_frame=lambda taken: stack.append(taken.frame))
    assert burst.frames == 20
    assert burst.refused == {"dropped": 1, "corrupt": 2, "missing": 1}
    for frame in stack:
        assert np.array_equal(frame.pixels, camera.expected(frame.sequence))


def test_abort_acts_within_a_frame_and_keeps_what_was_taken():
    done = []
    burst = run_capture(make_camera(), CapturePlan(frames=50), done.append, abort=lambda: len(done) >= 7)
    assert burst.outcome is BurstOutcome.ABORTED
    assert burst.frames == 7
    assert done[-1].done == 7


def test_an_unplugged_camera_leaves_an_incomplete_burst_and_an_absent_one_an_error():
    lost = make_camera(faults={10: CameraFault.UNPLUG}.get)
    burst = run_capture(lost, CapturePlan(frames=50))
    assert burst.outcome is BurstOutcome.DEVICE_LOST
    assert 0 < burst.frames < 10
    with pytest.raises(DeviceNotFoundError, match="reconnect"):
        run_capture(make_camera(faults=lambda _: CameraFault.UNPLUG), CapturePlan())


def test_a_camera_that_only_fails_ends_the_burst():
    camera = make_camera(faults=lambda n: CameraFault.ERROR_FLAG if n > 5 else None)
    burst = run_capture(camera, CapturePlan(frames=50, max_refused=8))
    assert burst.outcome is BurstOutcome.TOO_MANY_REFUSED
    assert burst.refused == {"corrupt": 9}


def test_settling_waits_for_a_camera_whose_brightness_still_changes():
    views = iter([pattern(level=level) for level in (0.2, 0.3, 0.4, 0.45)] + [pattern()] * 200)
    camera = SimulatedCamera(lambda: next(views), seed=1)
    burst = run_capture(camera, CapturePlan(frames=5))
    assert burst.mean.mean() == pytest.approx(0.5, abs=0.02)
    assert all(v.good for v in burst.verdicts if v.name in ("flicker", "settling"))


@pytest.mark.parametrize(
    ("view", "bad"),
    [
        (pattern(), set()),
        (pattern(level=1.1), {"saturation", "level"}),
        (pattern(level=0.05), {"level"}),
        (pattern(contrast=0.01), {"contrast"}),
        (cv2.GaussianBlur(pattern(192, 256, contrast=6.0), (0, 0), 9.0), {"focus"}),
    ],
)
def test_verdicts_name_what_is_wrong_and_only_that(view, bad):
    burst = run_capture(make_camera(view), CapturePlan(frames=8))
    assert {v.name for v in burst.verdicts if not v.good} >= bad
    if not bad:
        assert all(v.good for v in burst.verdicts), burst.verdicts


def test_focus_verdict_measures_the_period_of_the_pattern():
    x = np.arange(512)
    wave = 0.5 + 0.1 * (np.sin(2 * np.pi * x / 12)[None] + np.sin(2 * np.pi * x / 12)[:, None])
    burst = run_capture(make_camera(wave.astype(np.float32)), CapturePlan(frames=16))
    # The central difference underestimates the slope of a 12 px period by 5 %.
    assert verdict(burst, "focus").value == pytest.approx(12, rel=0.08)


def test_refresh_beat_and_warm_up_are_warned_of_with_the_remedy():
    camera = make_camera(exposure_s=0.01)
    burst = run_capture(camera, CapturePlan(frames=3, refresh_hz=60.0), rig_on_s=300.0)
    assert not verdict(burst, "refresh beat").good
    assert "0.016667 s" in verdict(burst, "refresh beat").advice
    assert "1500 s more" in verdict(burst, "warm-up").advice


def test_dark_frames_are_judged_as_dark_frames():
    noise = SensorNoise(dark_counts=64.0)
    burst = run_capture(
        make_camera(np.zeros((64, 64), np.float32), noise=noise), CapturePlan(role="dark", frames=20)
    )
    assert verdict(burst, "dark level").good
    # Read noise of 3 e at 0.403 counts/e, rounded to whole counts.
    expected = ((3 * 4031 / 1e4) ** 2 + 1 / 12) ** 0.5 / 4095
    assert float(np.sqrt((burst.std**2).mean())) == pytest.approx(expected, rel=0.02)


def test_settings_asked_and_read_back_are_recorded():
    burst = run_capture(make_camera(), CapturePlan(frames=2, exposure_s=0.02))
    exposure, gain = burst.settings
    assert (exposure.asked, exposure.granted) == (0.02, 0.02)
    assert (gain.asked, gain.granted) == (None, 1.0)
