"""A lamp's times, on a clock that somebody may set."""

import json

import pytest

from drivers.errors import DeviceRefusedError, DeviceTimeoutError
from drivers.projector.lamp_guard import LampGuard
from drivers.projector.protocol import PowerState
from drivers.simulated.projector.engine import ProjectorFault
from tests.drivers.projector.twins import make_link


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


def test_guards_of_one_journal_know_what_the_others_noted(tmp_path):
    now_s, journal = [1000.0], tmp_path / "lamp.json"
    one, other = (LampGuard(journal=journal, now_s=lambda: now_s[0]) for _ in range(2))
    one.lit()
    now_s[0] += 4000.0
    assert other.on_s == 4000.0
    one.put_out()
    now_s[0] += 5.0
    with pytest.raises(DeviceRefusedError, match="Wait 115 s"):
        other.may_light()
    now_s[0] += 200.0
    other.lit()
    assert set(json.loads(journal.read_text())) == {"on", "off"}
    other.put_out()
    other.not_put_out()
    assert one.on_s == 0.0


def lit_for(seconds):
    """A link, its twin's state and its clock, so long after the lamp was lit from here."""
    link, twin, clock = make_link("pjlink")
    link.turn_on()
    clock.advance_s(seconds)
    assert link.status().on_s == pytest.approx(seconds, abs=2)
    return link, twin.responder.state, clock


def test_a_lamp_that_is_switched_by_remote_control_counts_from_then():
    link, state, clock = lit_for(4000.0)
    state.turn_off()
    clock.advance_s(10.0)
    assert link.power() is PowerState.COOLING
    clock.advance_s(31.0)
    with pytest.raises(DeviceRefusedError, match="cycling faster"):
        link.turn_on()
    clock.advance_s(40_000.0)
    assert link.power() is PowerState.STANDBY
    state.turn_on()
    clock.advance_s(60.0)
    assert link.status().on_s is None  # it may have been lit at any time since
    state.turn_off()
    clock.advance_s(40.0)
    state.turn_on()
    clock.advance_s(20.0)
    assert link.power() is PowerState.WARMING
    clock.advance_s(60.0)
    assert link.status().on_s == pytest.approx(60.0, abs=2)


def test_a_lamp_whose_putting_out_was_not_answered_counts_as_put_out_and_one_that_refuses_does_not():
    faults = {}
    link, twin, clock = make_link(
        "escvp21", faults.get, guard=(guard := LampGuard(now_s=lambda: clock.now_s()))
    )
    link.turn_on()
    clock.advance_s(4000.0)
    faults[twin.commands + 1] = ProjectorFault.ERROR
    with pytest.raises(DeviceRefusedError):
        link.turn_off()
    assert guard.on_s == pytest.approx(4000.0, abs=10)
    faults[twin.commands + 1] = ProjectorFault.LATE
    with pytest.raises(DeviceTimeoutError):
        link.turn_off()
    assert guard.on_s is None
    clock.advance_s(40.0)
    with pytest.raises(DeviceRefusedError, match="cycling faster"):
        link.turn_on()
    assert twin.responder.state.ignitions == 1
