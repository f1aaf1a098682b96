"""A lamp's times, on a clock that somebody may set."""

import pytest

from drivers.errors import DeviceRefusedError
from drivers.projector.lamp_guard import LampGuard


def test_a_lamp_is_neither_lit_nor_put_out_too_soon_and_says_how_long_to_wait():
    now_s = [1000.0]
    guard = LampGuard(min_on_s=100.0, min_off_s=60.0, now_s=lambda: now_s[0])
    guard.may_light()
    assert guard.on_s is None
    guard.lit()
    now_s[0] += 70.0
    assert guard.on_s == 70.0
    with pytest.raises(DeviceRefusedError, match="Wait 30 s"):
        guard.may_put_out()
    now_s[0] += 30.0
    guard.may_put_out()
    guard.put_out()
    assert guard.on_s is None
    with pytest.raises(DeviceRefusedError, match="Wait 60 s"):
        guard.may_light()


def test_a_clock_that_is_set_back_gives_no_negative_time_and_locks_nobody_out():
    now_s = [1000.0]
    guard = LampGuard(now_s=lambda: now_s[0])
    guard.lit()
    now_s[0] = 400.0
    assert guard.on_s == 0.0
    guard.may_put_out()
