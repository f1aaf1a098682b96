"""Silent connections make room: counted, not timed."""

import contextlib
import socket
import time

import httpx
import pytest

from app.api import connections, server
from app.api.connections import Gate, most_connections
from drivers.simulated import SimulatedCamera
from tests.app.api.conftest import Live
from tests.app.rig.test_live_camera import SCENE


def silent(port: int, sent: bytes) -> socket.socket:
    held = socket.create_connection(("127.0.0.1", port), 30)
    held.sendall(sent)
    return held


def is_closed(held: socket.socket) -> bool:
    held.settimeout(0.0)
    try:
        return held.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def refused(held: socket.socket) -> bool:
    """Whether the service hung up, after some more of a header."""
    held.settimeout(30)
    try:
        held.sendall(b"x" * 4096)
    except OSError:
        return True
    return is_closed(held)


def ends(held: socket.socket) -> bool:
    """Whether the service hangs up, once it comes to it: less than half of the time for headers."""
    held.settimeout(connections.HEADERS_S / 2)
    try:
        return held.recv(1) == b""
    except ConnectionResetError:
        return True
    except TimeoutError:
        return False


def test_a_reader_is_answered_while_more_are_held_open_than_there_is_room_for(live: Live):
    most = most_connections()
    held = []
    try:
        for number in range(most + 50):
            held.append(silent(live.port, (b"", b"GET /api/health HTTP/1.1\r\nX: ")[number % 2]))
        with live.client() as reader:
            assert reader.get("/api/health").status_code == 200
        closed = [is_closed(one) for one in held]
        # The oldest made room; the newest are still there.
        assert sum(closed) >= 50
        assert all(closed[:40])
        assert not any(closed[-10:])
    finally:
        for one in held:
            one.close()


def test_headers_without_an_end_are_refused(live: Live):
    held = silent(live.port, b"GET /api/health HTTP/1.1\r\nX: ")
    with held:
        assert any(refused(held) for _ in range(300)) or ends(held)


def test_who_takes_too_long_to_ask_is_ended(tmp_path, monkeypatch):
    from app.api.factory import create_app
    from app.api.security.settings import new_token, service_config

    monkeypatch.setattr(connections, "HEADERS_S", 0.2)
    monkeypatch.setattr(connections, "BODY_S", 0.2)
    bound = server.listen("127.0.0.1", 0)
    port, token = bound.getsockname()[1], new_token()
    head = f"POST /api/jobs HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nAuthorization: Bearer {token}\r\n"
    body = "Content-Type: application/json\r\nContent-Length: 100\r\n\r\n{"
    with server.serving(create_app(service_config(tmp_path, token, port)), bound):
        for sent in ("", head, head + body):
            with silent(port, sent.encode()) as held:
                held.settimeout(60)
                try:
                    assert held.recv(1000) == b""
                except ConnectionResetError:
                    pass


@pytest.mark.parametrize("path", ["/api/events", "/api/devices/camera/live.mjpeg"])
def test_a_page_that_is_open_does_not_hold_up_the_end_of_the_service(tmp_path, capfd, path):
    from app.api.factory import create_app
    from app.api.security.settings import new_token, service_config

    bound = server.listen("127.0.0.1", 0)
    port, token = bound.getsockname()[1], new_token()
    app = create_app(service_config(tmp_path, token, port))
    app.state.services.camera.open("lab", lambda: SimulatedCamera(lambda: SCENE, seed=1))
    with contextlib.ExitStack() as held:
        with server.serving(app, bound):
            client = held.enter_context(
                httpx.Client(headers={"Authorization": f"Bearer {token}"}, timeout=60)
            )
            streamed = held.enter_context(client.stream("GET", f"http://127.0.0.1:{port}{path}"))
            assert streamed.status_code == 200
            parts = streamed.iter_raw()
            next(parts)
            began_s = time.monotonic()
        # Two seconds are those that an answer has which comes to its end.
        assert time.monotonic() - began_s < 1.9
    assert capfd.readouterr().err == ""


class Line:
    def __init__(self, gate):
        self.gate, self.ended = gate, False

    def end(self):
        self.ended = True
        self.gate.leave(self)


def test_one_client_has_its_share_and_ends_its_own_first():
    gate = Gate(most=8)
    calm = Line(gate)
    assert gate.enter(calm, "reader")
    gate.waits(calm)
    lines = [Line(gate) for _ in range(20)]
    for line in lines:
        assert gate.enter(line, "flood")
        gate.waits(line)
    assert [line.ended for line in lines] == [True] * 14 + [False] * 6
    assert not calm.ended
    for line in lines[14:]:
        gate.works(line)
    # What is being answered is not ended for others.
    assert not gate.enter(Line(gate), "flood")
    assert gate.enter(Line(gate), "another")
