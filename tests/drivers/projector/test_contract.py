"""What every projector owes its user: each dialect over its twin; a real one with `--projector`."""

import pytest

from drivers.errors import DeviceRefusedError
from drivers.projector.open import open_projector
from drivers.projector.protocol import Capability, PowerState, Projector
from tests.drivers.projector.twins import DIALECTS, make_link


@pytest.fixture(params=sorted(DIALECTS))
def rig(request):
    return request.param, *make_link(request.param)


def light(link, clock, twin):
    link.turn_on()
    clock.advance_s(twin.responder.state.warm_up_s + 1)
    assert link.power() is PowerState.ON


def test_warm_up_and_cooling_are_states(rig):
    name, link, _, clock = rig
    assert isinstance(link, Projector)
    assert link.power() is PowerState.STANDBY
    link.turn_on()
    if name != "nec":  # its status byte has no word for warming
        assert link.power() is PowerState.WARMING
    clock.advance_s(41.0)
    assert link.power() is PowerState.ON
    clock.advance_s(200.0)
    link.turn_off()
    if name != "optoma":  # it says "off" at once
        assert link.power() is PowerState.COOLING
    clock.advance_s(31.0)
    assert link.power() is PowerState.STANDBY


def test_what_is_set_is_what_the_projector_has(rig):
    name, link, twin, clock = rig
    light(link, clock, twin)
    state = twin.responder.state
    link.select_source(DIALECTS[name][2][1])
    link.mute(True)
    link.freeze(True)
    assert (state.source, state.muted, state.frozen) == (DIALECTS[name][2][1], True, True)
    link.mute(False)
    link.freeze(False)
    assert (state.muted, state.frozen) == (False, False)


def test_status_tells_what_the_dialect_can_tell_and_nothing_else(rig):
    name, link, twin, clock = rig
    light(link, clock, twin)
    status = link.status()
    assert status.power is PowerState.ON
    assert status.lamp_hours == 1234
    assert status.on_s == pytest.approx(41, abs=2)
    assert status.muted is (None if name == "optoma" else False)
    assert (status.name is None) == (Capability.NAME not in link.capabilities)
    assert status.errors == ()


def test_an_unknown_source_is_refused_and_the_old_one_stays(rig):
    name, link, twin, clock = rig
    light(link, clock, twin)
    with pytest.raises(DeviceRefusedError):
        link.select_source("99")
    assert twin.responder.state.source == DIALECTS[name][2][0]


def test_a_lamp_is_not_cycled_faster_than_allowed(rig):
    _, link, twin, clock = rig
    light(link, clock, twin)
    with pytest.raises(DeviceRefusedError, match=r"Wait \d+ s"):
        link.turn_off()
    clock.advance_s(120.0)
    link.turn_off()
    clock.advance_s(40.0)
    with pytest.raises(DeviceRefusedError, match="cycling faster"):
        link.turn_on()
    assert twin.responder.state.ignitions == 1


def test_the_wire_log_can_be_read(rig):
    _, link, _, _ = rig
    link.power()
    directions = [entry.direction for entry in link.log.entries]
    assert directions[:2] == ["!", ">"]
    assert "<" in directions
    assert all(str(entry).isprintable() for entry in link.log.entries)


def test_a_line_that_was_closed_while_idle_is_opened_again_for_a_command(rig):
    name, link, twin, clock = rig
    light(link, clock, twin)
    twin.responder.idle_s = 30.0  # as PJLink's projectors do
    clock.advance_s(31.0)
    link.select_source(DIALECTS[name][2][1])
    clock.advance_s(31.0)
    link.mute(True)
    assert (twin.responder.state.source, twin.responder.state.muted) == (DIALECTS[name][2][1], True)


@pytest.mark.hardware
def test_a_real_projector_answers_within_its_time(request):
    url = request.config.getoption("--projector")
    if url is None:
        pytest.skip("no --projector given")
    with open_projector(url) as projector:
        assert projector.power() in PowerState
        assert projector.status().power is not PowerState.SILENT
