import pytest

from drivers.errors import FrameError, FrameFault
from drivers.gate import CONTROL_FRAMES, Arrival, FrameGate


def arrival(sequence, exposed_s, flagged=False, bytes_used=100):
    return Arrival(sequence, exposed_s, flagged, bytes_used)


def refusal(gate, item, consecutive=True):
    with pytest.raises(FrameError) as caught:
        gate.admit(item, consecutive=consecutive)
    return caught.value.fault, caught.value.lost


def test_a_steady_stream_passes_also_across_the_wrap_of_the_counter():
    gate = FrameGate(100, 0.04)
    for step in range(6):
        gate.admit(arrival((2**32 - 3 + step) % 2**32, 0.04 * step), consecutive=True)
    assert not gate.refused


def test_losses_are_counted_and_only_refused_where_frames_must_follow():
    gate = FrameGate(100, 0.04)
    gate.admit(arrival(1, 0.0), consecutive=True)
    assert refusal(gate, arrival(5, 0.16)) == (FrameFault.DROPPED, 3)
    gate.admit(arrival(9, 0.32), consecutive=False)
    gate.admit(arrival(10, 0.36), consecutive=True)
    assert gate.refused == {FrameFault.DROPPED: 3}


def test_a_jump_in_time_alone_is_a_loss_too():
    gate = FrameGate(100, 0.04)
    gate.admit(arrival(1, 0.0), consecutive=True)
    gate.admit(arrival(2, 0.055), consecutive=True)  # jitter of a third of a period
    assert refusal(gate, arrival(3, 0.15))[0] is FrameFault.LATE


@pytest.mark.parametrize("bad", [arrival(2, 0.04, flagged=True), arrival(2, 0.04, bytes_used=99)])
def test_flagged_and_short_buffers_are_corrupt(bad):
    gate = FrameGate(100, 0.04)
    gate.admit(arrival(1, 0.0), consecutive=True)
    assert refusal(gate, bad)[0] is FrameFault.CORRUPT
    gate.admit(arrival(3, 0.08), consecutive=True)


def test_old_buffers_are_stale():
    gate = FrameGate(100, 0.04)
    gate.admit(arrival(5, 0.2), consecutive=True)
    assert refusal(gate, arrival(5, 0.2))[0] is FrameFault.STALE
    assert refusal(gate, arrival(4, 0.16), consecutive=False)[0] is FrameFault.STALE
    assert gate.is_stale(arrival(6, 0.24), fresh_after_s=1.0)
    assert not gate.is_stale(arrival(7, 1.0), fresh_after_s=1.0)


def test_a_long_exposure_takes_whole_periods_and_what_comes_in_them_is_not_late():
    gate = FrameGate(100, 1 / 30)
    gate.note_change(4 / 60)
    assert gate.period_s == pytest.approx(2 / 30)
    assert gate.patience_s == 1.0
    for step in range(12):
        # Some cameras need one period more than the exposure takes.
        gate.admit(arrival(step, step * 3 / 30), consecutive=True)
    gate.note_change(1.0)
    assert gate.patience_s == pytest.approx(3.0)
    gate.note_change(0.045)
    assert gate.period_s == pytest.approx(2 / 30)


def test_frames_of_the_longer_exposure_before_are_not_late_and_a_loss_names_the_exposure():
    gate = FrameGate(100, 1 / 30)
    gate.note_change(0.1)
    gate.note_change(0.01)
    assert gate.since_change == 0
    for step in range(CONTROL_FRAMES):
        gate.admit(arrival(step, 0.1 * step), consecutive=True)
    assert gate.since_change == CONTROL_FRAMES - 1
    with pytest.raises(FrameError, match=r"the period is 0.0333 s at an exposure of 0.01 s"):
        gate.admit(arrival(CONTROL_FRAMES, 0.1 * CONTROL_FRAMES), consecutive=True)


def test_without_a_rate_no_frame_is_late_and_one_is_waited_for_longer():
    gate = FrameGate(100, None, 2.0)
    assert gate.period_s is None
    assert gate.patience_s > 6.0
    for step in range(3):
        gate.admit(arrival(step, 4.0 * step), consecutive=True)
