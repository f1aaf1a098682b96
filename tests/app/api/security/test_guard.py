"""Nobody passes who should not: hostile headers on every route of the app, found by iterating over it."""

import http.client
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.routing import Route, WebSocketRoute

from app.api.factory import create_app
from app.api.security.settings import Limits, new_token, service_config
from app.api.server import listen, serving
from tests.app.api.conftest import Live, is_problem
from tests.run_async import run_async

TOKEN = "t" * 43
PORT = 8765
GOOD_HOST = b"127.0.0.1:8765"
GOOD_BEARER = (b"authorization", b"Bearer " + TOKEN.encode())
NO_LIMITS = Limits(reads_per_s=1e9, writes_per_s=1e9, failures_per_s=1e9)


def routes_of(app: FastAPI) -> Iterator[tuple[str, str, str]]:
    """(kind, method, path) of every address that the app answers, WebSockets and files included."""
    pending = [("", route) for route in app.routes]
    while pending:
        prefix, route = pending.pop()
        if isinstance(route, APIWebSocketRoute | WebSocketRoute):
            yield "websocket", "GET", filled(prefix + route.path)
        elif isinstance(route, APIRoute | Route):
            for method in sorted(route.methods or {"GET"}):
                yield "http", method, filled(prefix + route.path)
        else:
            included = route.include_context
            pending.extend((prefix + included.prefix, inner) for inner in route.original_router.routes)


def filled(path: str) -> str:
    while "{" in path:
        start, end = path.index("{"), path.index("}")
        path = path[:start] + "x1" + path[end + 1 :]
    return path


def ask(
    app: FastAPI, kind: str, method: str, path: str, headers: list[tuple[bytes, bytes]]
) -> tuple[int, bytes]:
    """Call the app as a server would; return status and body (101 for an accepted WebSocket)."""
    scope: dict[str, Any] = {
        "type": kind,
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": method,
        "scheme": "http" if kind == "http" else "ws",
        "path": path,
        "raw_path": path.encode(),
        "root_path": "",
        "query_string": b"",
        "headers": headers,
        "client": ("127.0.0.1", 5),
        "server": ("127.0.0.1", PORT),
        "extensions": {"websocket.http.response": {}},
        "subprotocols": [],
    }
    if kind == "websocket":
        del scope["method"]
    answer: list[dict[str, Any]] = []
    asked: list[bool] = []

    async def receive() -> dict[str, Any]:
        if kind == "websocket":
            return {"type": "websocket.connect" if not answer else "websocket.disconnect", "code": 1000}
        if asked:
            return {"type": "http.disconnect"}
        asked.append(True)
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        answer.append(message)

    run_async(app(scope, receive, send))
    if answer[0]["type"] == "websocket.accept":
        return 101, b""
    assert answer, (kind, method, path)
    return answer[0]["status"], b"".join(m.get("body", b"") for m in answer)


def hostile_sets() -> dict[str, list[tuple[bytes, bytes]]]:
    """Headers that other pages, other hosts and other users send; `page` marks those that hit files too."""
    host = (b"host", GOOD_HOST)
    bad_hosts = [
        *(b"evil.example", b"evil.example:8765", b"127.0.0.1", b"127.0.0.1:80", b"localhost:8766"),
        *(b"127.0.0.1:8765.evil.example", b"127.0.0.1:8765@evil", b"0.0.0.0:8765", b"[::]:8765", b""),
        *(b"127.1:8765", b"2130706433:8765", b"localhost.:8765", b" 127.0.0.1:8765"),
    ]
    bad_origins = [
        *(b"null", b"http://evil.example", b"https://127.0.0.1:8765", b"http://127.0.0.1:8766"),
        *(b"http://127.0.0.1", b"http://127.0.0.1:8765.evil.example", b"http://127.0.0.1:8765/", b"*"),
        *(b"http://127.0.0.1:8765 http://evil.example", b"", b"file://", b"http://localhost:87650"),
    ]
    sets = {f"page: host {value!r}": [(b"host", value), GOOD_BEARER] for value in bad_hosts}
    sets["page: no host"] = [GOOD_BEARER]
    sets["page: two hosts"] = [host, (b"host", b"evil.example"), GOOD_BEARER]
    sets |= {f"page: origin {value!r}": [host, GOOD_BEARER, (b"origin", value)] for value in bad_origins}
    good_origin = (b"origin", b"http://127.0.0.1:8765")
    sets["page: two origins"] = [host, GOOD_BEARER, good_origin, (b"origin", b"http://evil.example")]
    for site in (b"cross-site", b"same-site", b"", b"same-origin, cross-site"):
        sets[f"page: site {site!r}"] = [host, GOOD_BEARER, (b"sec-fetch-site", site)]
    bad_tokens = [
        *(b"", b"Bearer", b"Bearer ", b"Bearer " + b"u" * 43, b"Bearer " + TOKEN[:-1].encode()),
        *(b"Bearer " + TOKEN.encode() + b"x", TOKEN.encode(), b"Basic " + TOKEN.encode()),
        b"Bearer " + TOKEN.upper().encode(),
    ]
    sets |= {f"token {value!r}": [host, (b"authorization", value)] for value in bad_tokens}
    sets["two tokens"] = [host, GOOD_BEARER, GOOD_BEARER]
    sets["nothing"] = [host]
    for cookie in (TOKEN.encode(), b"", b"airlens", b"0" * 64):
        sets[f"cookie {cookie!r}"] = [host, good_origin, (b"cookie", b"airlens_8765=" + cookie)]
    sets["forwarded"] = [host, (b"x-forwarded-for", b"127.0.0.1"), (b"x-forwarded-host", GOOD_HOST)]
    return sets


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> FastAPI:
    root = tmp_path_factory.mktemp("guarded")
    return create_app(service_config(root, TOKEN, PORT, limits=NO_LIMITS))


def test_the_iteration_finds_every_described_route_and_the_live_picture(guarded: FastAPI):
    described = {
        ("http", method.upper(), filled(path))
        for path, item in guarded.openapi()["paths"].items()
        for method in item
    }
    found = set(routes_of(guarded))
    assert described <= found
    assert ("websocket", "GET", "/api/devices/camera/live") in found


def test_no_hostile_header_set_is_accepted_on_any_route(guarded: FastAPI):
    sets, routes = hostile_sets(), list(routes_of(guarded))
    assert len(sets) >= 40
    assert len(routes) >= 40
    for name, headers in sets.items():
        for kind, method, path in routes:
            is_file = path in ("/", "/index.html", "/favicon.svg") or path.startswith("/assets/")
            if is_file and not name.startswith("page: "):
                continue  # The page's own files hold no data and are shown before there is a token.
            status, _ = ask(guarded, kind, method, path, headers)
            assert status in (401, 403), f"{name} was let in to {kind} {method} {path}: {status}"


def test_the_same_routes_answer_the_holder_of_the_token(guarded: FastAPI):
    good = [(b"host", GOOD_HOST), GOOD_BEARER]
    statuses = {ask(guarded, *route, good)[0] for route in routes_of(guarded)}
    assert not statuses & {401, 403}


def cookie_of(app: FastAPI) -> bytes:
    return b"airlens_8765=" + app.state.services.access.sessions.open("127.0.0.1:8765").encode()


def test_a_cookie_may_read_but_needs_an_origin_to_change(guarded: FastAPI):
    base = [(b"host", GOOD_HOST), (b"cookie", b"other=1; " + cookie_of(guarded))]
    origin = (b"origin", b"http://127.0.0.1:8765")
    assert ask(guarded, "http", "GET", "/api/health", base)[0] == 200
    other_host = [(b"host", b"localhost:8765"), *base[1:]]
    assert ask(guarded, "http", "GET", "/api/health", other_host)[0] == 401
    assert ask(guarded, "http", "DELETE", "/api/session", base)[0] == 403
    assert ask(guarded, "http", "DELETE", "/api/session", [*base, origin])[0] == 200
    # Logging out ends the session itself, not only this browser's copy of its cookie.
    assert ask(guarded, "http", "GET", "/api/health", base)[0] == 401


def test_a_cookie_dies_with_its_token(guarded: FastAPI, tmp_path):
    other = create_app(service_config(tmp_path, "n" * 43, PORT, limits=NO_LIMITS))
    headers = [(b"host", GOOD_HOST), (b"cookie", cookie_of(guarded))]
    assert ask(other, "http", "GET", "/api/health", headers)[0] == 401


def test_guessing_tokens_is_slowed_but_the_operator_is_not(tmp_path):
    app = create_app(service_config(tmp_path, TOKEN, PORT, limits=Limits(failures_per_s=1.0)))
    bad = [(b"host", GOOD_HOST), (b"authorization", b"Bearer guess")]
    statuses = [ask(app, "http", "GET", "/api/health", bad)[0] for _ in range(12)]
    assert statuses[0] == 401
    assert statuses[-1] == 429
    assert ask(app, "http", "GET", "/api/health", [(b"host", GOOD_HOST), GOOD_BEARER])[0] == 200


def test_a_flood_of_changes_is_refused_with_the_time_to_wait(tmp_path):
    app = create_app(service_config(tmp_path, TOKEN, PORT, limits=Limits(writes_per_s=1.0)))
    good = [(b"host", GOOD_HOST), GOOD_BEARER]
    statuses = [ask(app, "http", "POST", "/api/session", good)[0] for _ in range(8)]
    assert statuses.count(200) == 5
    assert statuses[-1] == 429


def test_every_answer_carries_the_policies(live: Live):
    with live.client() as client:
        for path in ("/", "/api/health", "/api/nothing", "/assets/none.js"):
            headers = client.get(path).headers
            assert "default-src 'none'" in headers["content-security-policy"]
            assert headers["x-content-type-options"] == "nosniff"
            assert headers["cross-origin-resource-policy"] == "same-origin"
        page = client.get("/").headers["content-security-policy"]
        assert "require-trusted-types-for 'script'" in page
        assert "unsafe" not in page


def test_the_token_is_exchanged_for_a_cookie_that_scripts_cannot_read(live: Live):
    with httpx.Client(base_url=live.url) as browser:
        answer = browser.post("/api/session", headers={**live.bearer, "Origin": live.url})
        cookie = answer.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert live.token.lower() not in cookie
        assert browser.get("/api/health").status_code == 200


def test_the_audit_log_names_refusals_and_changes_but_no_secret(live: Live):
    with live.client() as client:
        client.delete("/api/uploads/u0000?token=" + live.token)
        httpx.get(live.url + "/api/health", headers={"Authorization": "Bearer wrong-secret"})
    log = (live.config.data_root / "service" / "audit.jsonl").read_text()
    assert '"/api/uploads/u0000", "status": 404' in log
    assert '"code": "token_missing"' in log
    assert live.token not in log
    assert "wrong-secret" not in log


@pytest.mark.parametrize(
    ("method", "path", "body", "code"),
    [
        ("GET", "/api/nothing", None, "not_found"),
        ("GET", "/nothing", None, "not_found"),
        ("PATCH", "/api/health", None, "method_not_allowed"),
        ("DELETE", "/api/uploads/-", None, "invalid"),
        ("DELETE", "/api/uploads/u1", None, "not_found"),
        ("POST", "/api/uploads", b"x", "media_type_refused"),
        ("POST", "/api/session", b"x" * (1 << 20) + b"x", "too_large"),
    ],
)
def test_every_error_has_one_shape(live: Live, method: str, path: str, body: bytes | None, code: str):
    with live.client() as client:
        assert is_problem(client.request(method, path, content=body), code)


def test_a_body_without_a_length_is_bounded_while_it_comes(live: Live):
    connection = http.client.HTTPConnection("127.0.0.1", live.port, timeout=100)
    connection.request(
        "POST",
        "/api/uploads",
        body=(b"\x93NUMPY" + b"x" * 65536 for _ in range(8)),
        headers={**live.bearer, "Content-Type": "application/octet-stream"},
        encode_chunked=True,
    )
    assert connection.getresponse().status == 422


def test_streams_beyond_the_limit_are_refused_until_one_is_closed(tmp_path: Path):
    bound = listen("127.0.0.1", 0)
    port, token = bound.getsockname()[1], new_token()
    config = service_config(tmp_path, token, port, limits=Limits(streams=2))
    headers = {"Authorization": f"Bearer {token}"}
    url = f"http://127.0.0.1:{port}"
    with (
        serving(create_app(config), bound),
        httpx.Client(base_url=url, headers=headers, timeout=100) as client,
    ):
        with client.stream("GET", "/api/events") as one, client.stream("GET", "/api/events") as two:
            assert (one.status_code, two.status_code) == (200, 200)
            refused = client.get("/api/events")
            assert is_problem(refused, "rate_limited")
            assert refused.headers["retry-after"] == "5"
            assert client.get("/api/health").status_code == 200
        until_s = time.monotonic() + 100
        while True:
            with client.stream("GET", "/api/events") as again:
                if again.status_code == 200:
                    break
            assert time.monotonic() < until_s
            time.sleep(0.05)


def test_an_open_stream_ends_with_its_session_and_a_tokens_goes_on(live: Live):
    with live.client() as holder, httpx.Client(base_url=live.url, timeout=100) as browser:
        browser.post("/api/session", headers={**live.bearer, "Origin": live.url})
        with browser.stream("GET", "/api/events") as seen, holder.stream("GET", "/api/events") as other:
            lines, others = seen.iter_lines(), other.iter_lines()
            assert next(lines) == next(others) == "retry: 1000"
            browser.delete("/api/session", headers={"Origin": live.url})
            until_s = time.monotonic() + 100
            # A stream never ends by itself: it says that it is still there, for ever.
            for _ in lines:
                assert time.monotonic() < until_s
            assert next(line for line in others if line.startswith(":")) == ": still here"
