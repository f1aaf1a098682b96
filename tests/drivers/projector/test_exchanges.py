"""Byte-exact exchanges from the manuals: a port that plays them and fails on any other byte."""

import hashlib

import pytest

from drivers.errors import DeviceNotFoundError, DeviceRefusedError
from drivers.projector.dialect import AnswerKind, Request, Verb
from drivers.projector.lamp_guard import LampGuard
from drivers.projector.link import ProjectorLink
from drivers.projector.pjlink import greeting_digest
from drivers.projector.pjlink_port import PjLinkPort
from drivers.projector.protocol import PowerState
from drivers.simulated import VirtualClock
from tests.drivers.projector.twins import DIALECTS


class ScriptedPort:
    """Plays (expected bytes, reply) pairs in order."""

    name = "script"

    def __init__(self, clock, exchanges, greeting=b""):
        self.clock, self.exchanges, self.pending = clock, list(exchanges), greeting

    def open(self):
        pass

    def write(self, data):
        assert self.exchanges, f"nothing more was expected, got {data!r}"
        expected, reply = self.exchanges.pop(0)
        assert data == expected
        self.pending += reply

    def read(self, timeout_s):
        data, self.pending = self.pending, b""
        if not data:
            self.clock.sleep_s(timeout_s)
        return data

    def close(self):
        pass


def link_of(name, exchanges, *, greeting=b"", password=""):
    clock = VirtualClock()
    port = ScriptedPort(clock, exchanges, greeting)
    line = PjLinkPort(port, password, clock) if name == "pjlink" else port
    return ProjectorLink(DIALECTS[name][0](), line, guard=LampGuard(now_s=clock.now_s), clock=clock), port


def test_epson_powers_on_and_asks_as_the_users_guide_says():
    link, port = link_of("escvp21", [(b"PWR?\r", b"PWR=00\r:"), (b"PWR ON\r", b"")])
    link.turn_on()
    assert link.power() is PowerState.WARMING
    port.pending = b":"
    port.exchanges = [
        (b"PWR?\r", b"PWR=01\r:"),
        (b"SOURCE 30\r", b":"),
        (b"MUTE ON\r", b":"),
        (b"MUTE?\r", b"MUTE=ON\r:"),
        (b"SOURCE 77\r", b"ERR\r:"),
    ]
    assert link.power() is PowerState.ON
    link.select_source("30")
    link.mute(True)
    with pytest.raises(DeviceRefusedError):
        link.select_source("77")
    assert port.exchanges == []


def test_nec_frames_carry_the_checksums_of_the_manual():
    on, off = bytes.fromhex("020000000002"), bytes.fromhex("020100000003")
    mute, asked = bytes.fromhex("021000000012"), bytes.fromhex("00850000010389")
    dialect = DIALECTS["nec"][0]()
    assert dialect.encode(Request(Verb.POWER_ON)) == on
    assert dialect.encode(Request(Verb.POWER_OFF)) == off
    assert dialect.encode(Request(Verb.MUTE)) == mute
    assert dialect.encode(Request(Verb.ASK_MUTE)) == asked
    assert dialect.encode(Request(Verb.SELECT_SOURCE, "1A")) == bytes.fromhex(
        "02030000020 11A22".replace(" ", "")
    )
    done = bytes.fromhex("2210012000") + bytes([0x53])
    assert dialect.split(done, idle=False) == ([done], b"")
    assert dialect.decode(Request(Verb.MUTE), done).kind is AnswerKind.DONE
    inhibited = bytes.fromhex("A2010120 02 02 0D".replace(" ", ""))
    inhibited += bytes([sum(inhibited) & 0xFF])
    assert dialect.decode(Request(Verb.POWER_OFF), inhibited).kind is AnswerKind.BUSY


def test_pjlink_digest_is_the_specifications_own_example():
    assert greeting_digest(b"PJLINK 1 498e4a67", "JBMIAProjectorLink") == b"5d8409bc1c3fa39749434aa3a5c38682"
    assert greeting_digest(b"PJLINK 0", "anything") == b""
    assert greeting_digest(b"SSH-2.0-OpenSSH", "") is None


def test_pjlink_sends_the_digest_with_the_first_command_only():
    digest = hashlib.md5(b"498e4a67secret", usedforsecurity=False).hexdigest().encode()
    script = [
        (digest + b"%1POWR ?\r", b"%1POWR=0\r"),
        (b"%1POWR ?\r", b"%1POWR=0\r"),
        (b"%1POWR 1\r", b"%1POWR=OK\r"),
    ]
    link, port = link_of("pjlink", script, greeting=b"PJLINK 1 498e4a67\r", password="secret")
    assert link.power() is PowerState.STANDBY
    link.turn_on()
    assert port.exchanges == []


def test_pjlink_without_the_wanted_password_says_so_and_a_stranger_is_told():
    link, _ = link_of("pjlink", [], greeting=b"PJLINK 1 498e4a67\r")
    with pytest.raises(DeviceRefusedError, match="password"):
        link.power()
    stranger, _ = link_of("pjlink", [], greeting=b"SSH-2.0-OpenSSH_9\r\n")
    with pytest.raises(DeviceNotFoundError, match="instead of PJLINK"):
        stranger.power()


def test_pjlink_says_that_a_password_is_wrong_and_where_it_comes_from():
    digest = hashlib.md5(b"498e4a67wrong", usedforsecurity=False).hexdigest().encode()
    for act in (ProjectorLink.power, ProjectorLink.status, ProjectorLink.turn_on):
        script = [(digest + b"%1POWR ?\r", b"PJLINK ERRA\r")]
        link, _ = link_of("pjlink", script, greeting=b"PJLINK 1 498e4a67\r", password="wrong")
        with pytest.raises(DeviceRefusedError, match="AIRLENS_PROJECTOR_PASSWORD"):
            act(link)


def test_benq_echo_prompt_and_block_are_told_apart():
    link, _ = link_of(
        "benq",
        [
            (b"\r*pow=?#\r", b">*pow=?#\r\n*POW=ON#\r\n>"),
            (b"\r*blank=on#\r", b"*blank=on#\r\n*BLANK=ON#\r\n>"),
            (b"\r*blank=?#\r", b">*blank=?#\r\n*BLANK=ON#\r\n>"),
            (b"\r*pow=?#\r", b">*pow=?#\r\n*Block item#\r\n>"),
        ],
    )
    assert link.power() is PowerState.ON
    link.mute(True)
    assert link.power() is PowerState.WARMING


def test_optoma_information_is_read_by_its_width_and_news_is_not_an_answer():
    link, _ = link_of(
        "optoma",
        [
            (b"~00150 1\r", b"INFO0\rOK1043201C0110\r"),
            (b"~00150 1\r", b"OK1043201C0110\r"),
            (b"~00150 1\r", b"OK1043201C0110\r"),
            (b"~00150 1\r", b"OK1043201C0110\r"),
            (b"~0002 1\r", b"P"),
        ],
    )
    assert link.power() is PowerState.ON
    status = link.status()
    assert (status.lamp_hours, status.source) == (432, "01")
    link.mute(True)


def test_a_model_that_does_not_know_a_command_lacks_it_and_does_not_fail():
    asks = [b"SOURCE", b"MUTE", b"FREEZE", b"LAMP", b"ERR", b"SNO"]
    answers = {b"FREEZE": b"ERR\r:", b"MUTE": b"MUTE=ON\r:"}
    script = [(b"PWR?\r", b"PWR=01\r:")]
    for name in asks:  # a refusal is asked once more before it is believed
        script += [(name + b"?\r", answers.get(name, name + b"=00\r:"))] * (2 if name == b"FREEZE" else 1)
    script = 2 * script
    link, port = link_of("escvp21", script)
    status = link.status()
    assert status.frozen is None
    assert status.muted is True
    link.status()
    assert "freeze" not in link.capabilities
    assert port.exchanges == []


def test_an_answer_that_comes_too_late_is_not_taken_for_the_next_one():
    link, port = link_of("escvp21", [(b"PWR?\r", b"")])
    assert link.power() is PowerState.SILENT
    port.pending = b"PWR=01\r:"
    port.exchanges = [(b"PWR?\r", b"PWR=00\r:")] * 2
    assert link.power() is PowerState.STANDBY
