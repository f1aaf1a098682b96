"""A session ends: by logging out, at rest, at its age, with its token; and it survives a restart."""

import pytest

from app.api.security.sessions import MOST, Sessions
from app.api.security.settings import Limits
from app.errors import BadInputError

HOST = "127.0.0.1:8765"


class Clock:
    def __init__(self):
        self.now_s = 1e9

    def __call__(self):
        return self.now_s


def sessions(tmp_path, clock, token="t" * 43):
    return Sessions(tmp_path / "sessions.json", token, 100.0, 1000.0, clock, clock)


def test_a_session_ends_at_rest_and_at_its_age(tmp_path):
    clock = Clock()
    found = sessions(tmp_path, clock)
    used, rested = found.open(HOST), found.open(HOST)
    for _ in range(11):
        clock.now_s += 90.0
        assert found.is_open(used, HOST)
    clock.now_s += 20.0
    assert not found.is_open(used, HOST)
    assert not found.is_open(rested, HOST)


def test_a_look_is_no_use(tmp_path):
    clock = Clock()
    found = sessions(tmp_path, clock)
    secret = found.open(HOST)
    clock.now_s += 90.0
    assert found.is_open(secret, HOST, use=False)
    clock.now_s += 20.0
    assert not found.is_open(secret, HOST)


def test_a_session_is_of_one_host_one_token_and_one_life(tmp_path):
    clock = Clock()
    found = sessions(tmp_path, clock)
    secret, other = found.open(HOST), found.open(HOST)
    assert not found.is_open(secret, "127.0.0.1:9999")
    assert not found.is_open("guess", HOST)
    found.close(other)
    clock.now_s += 90.0
    restarted = sessions(tmp_path, clock)
    assert restarted.is_open(secret, HOST)
    assert not restarted.is_open(other, HOST)
    assert not sessions(tmp_path, clock, "n" * 43).is_open(secret, HOST)
    clock.now_s -= 1e6
    assert not restarted.is_open(secret, HOST)
    text = (tmp_path / "sessions.json").read_text()
    assert secret not in text


def test_sessions_are_bounded_and_a_damaged_file_ends_them(tmp_path):
    found = sessions(tmp_path, Clock())
    opened = [found.open(HOST) for _ in range(MOST + 1)]
    assert [found.is_open(secret, HOST) for secret in opened] == [False] + [True] * MOST
    (tmp_path / "sessions.json").write_text("[" * 3000)
    assert not sessions(tmp_path, Clock()).is_open(opened[-1], HOST)


@pytest.mark.parametrize("limits", [(0.0, 10.0), (20.0, 10.0), (10.0, 1e9)])
def test_limits_without_an_end_are_refused(limits):
    with pytest.raises(BadInputError, match="Sessions of"):
        Limits(session_idle_s=limits[0], session_s=limits[1])
