import pytest

from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.errors import DeviceSettingError
from drivers.sequence import check_times, evenly, run_sequence
from drivers.simulated import SimulatedCamera, VirtualClock
from tests.drivers.scenes import pattern


def make_take(clock):
    view = pattern()
    camera = SimulatedCamera(lambda: view, seed=1, clock=clock)
    return lambda start: run_capture(camera, CapturePlan(role="flow", frames=5, settle_frames=0), clock=clock)


def test_bursts_begin_when_they_are_due():
    clock = VirtualClock()
    done = run_sequence(evenly(4, 2.0), make_take(clock), clock=clock)
    assert [start.due_s for start, _ in done] == [0.0, 2.0, 4.0, 6.0]
    assert [start.began_s for start, _ in done] == pytest.approx([0.0, 2.0, 4.0, 6.0], abs=1e-6)
    times = [burst.records[0].timestamp_s for _, burst in done]
    assert times == pytest.approx([0.0, 2.0, 4.0, 6.0], abs=1 / 30)


def test_an_abort_ends_the_waiting():
    clock = VirtualClock()
    done = run_sequence(evenly(9, 10.0), make_take(clock), clock=clock, abort=lambda: clock.now_s() > 15)
    assert len(done) == 2
    assert clock.now_s() < 15.2


def test_times_that_cannot_be_kept_are_refused_before():
    check_times(evenly(3, 5.0), 4.0)
    check_times(evenly(3, 5.0), 5.0)  # one after the other without a pause
    with pytest.raises(DeviceSettingError, match="takes 6 s"):
        check_times(evenly(3, 5.0), 6.0)
    with pytest.raises(DeviceSettingError, match="must rise"):
        check_times((0.0, 2.0, 1.0), 0.1)
