"""The one guard before everything: access rules, rates, sizes, headers and audit, for HTTP and WebSocket.

Pure ASGI, outermost: no route, static file or error handler can be reached around it.
"""

import asyncio

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.models.problem import MEDIA_TYPE
from app.api.security.access import SAFE_METHODS, Access, Caller
from app.api.security.audit import AuditLog
from app.api.security.headers import headers_for
from app.api.security.rate import RateLimiter
from app.api.security.settings import Limits
from app.api.wire.problems import ApiError, body_of

PUBLIC_FILES = frozenset({"/", "/index.html", "/favicon.svg"})
PUBLIC_FOLDER = "/assets/"
UPLOADS = "/api/uploads"
# How often a stream looks whether its session is still open.
LOOK_S = 1.0
# Answers without an end: each holds a connection, and memory, for as long as somebody looks.
STREAMS = frozenset({"/api/events", "/api/devices/camera/live", "/api/devices/camera/live.mjpeg"})


class Guard:
    """Lets through what `access` allows, within `limits`; answers the rest itself."""

    def __init__(self, app: ASGIApp, access: Access, limits: Limits, audit: AuditLog) -> None:
        self._app = app
        self._access = access
        self._limits = limits
        self._audit = audit
        self._reads = RateLimiter(limits.reads_per_s)
        self._writes = RateLimiter(limits.writes_per_s)
        self._failures = RateLimiter(limits.failures_per_s)
        self._open_streams = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is not None:
            await self._refuse(scope, send, refusal)
            return
        streams = scope["path"] in STREAMS
        self._open_streams += streams
        try:
            await (self._stream if streams else self._pass)(scope, receive, send)
        finally:
            self._open_streams -= streams

    async def _stream(self, scope: Scope, receive: Receive, send: Send) -> None:
        """An answer without an end of its own. One that began, and that is ended here, is ended as a whole."""
        open_ = False

        async def watched(message: Message) -> None:
            nonlocal open_
            open_ = message["type"] == "http.response.start" or message.get("more_body", False)
            await send(message)

        await self._pass(scope, self._while_open(scope, receive), watched)
        if open_:
            await send({"type": "http.response.body", "body": b""})

    async def _pass(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await self._app(scope, receive, send)
        else:
            await self._app(scope, self._bounded(scope, receive), self._finished(scope, send))

    def _while_open(self, scope: Scope, receive: Receive) -> Receive:
        """A stream ends with the session that opened it: its route hears that the caller is gone."""
        caller = _caller(scope)

        async def received() -> Message:
            waiting = asyncio.ensure_future(receive())
            try:
                while not (await asyncio.wait({waiting}, timeout=LOOK_S))[0]:
                    if not self._access.still(caller):
                        return {"type": f"{scope['type']}.disconnect", "code": 1008}
                return waiting.result()
            finally:
                waiting.cancel()

        return received

    def _refusal(self, scope: Scope) -> ApiError | None:
        caller = _caller(scope)
        client = client_of(scope)
        refusal = self._access.refusal(caller)
        if refusal is not None:
            wait_s = self._failures.wait_s(client)
            return _too_many(wait_s) if wait_s and refusal.code == "token_missing" else refusal
        bucket = self._reads if caller.method in SAFE_METHODS else self._writes
        wait_s = bucket.wait_s(client)
        if wait_s:
            return _too_many(wait_s)
        if scope["path"] in STREAMS and self._open_streams >= self._limits.streams:
            cause = f"{self._open_streams} streams are open, as many as this service keeps."
            return ApiError("rate_limited", cause, "Close another page of it.", headers={"Retry-After": "5"})
        return self._oversized(scope, caller)

    def _oversized(self, scope: Scope, caller: Caller) -> ApiError | None:
        lengths = caller.values(b"content-length")
        if not lengths:
            return None
        if not (len(lengths) == 1 and lengths[0].isdigit() and len(lengths[0]) < 20):
            return ApiError("bad_request", "Content-Length is not one number.")
        limit = self._largest(scope["path"])
        return _too_large(limit) if int(lengths[0]) > limit else None

    def _largest(self, path: str) -> int:
        return self._limits.upload_bytes if path == UPLOADS else self._limits.json_bytes

    def _bounded(self, scope: Scope, receive: Receive) -> Receive:
        limit = self._largest(scope["path"])
        seen = 0

        async def bounded() -> Message:
            nonlocal seen
            message = await receive()
            seen += len(message.get("body", b""))
            if seen > limit:
                raise _too_large(limit)
            return message

        return bounded

    def _finished(self, scope: Scope, send: Send) -> Send:
        async def finished(message: Message) -> None:
            if message["type"] == "http.response.start":
                _complete(message, scope["path"])
                if scope["method"] not in SAFE_METHODS:
                    self._audit.record(
                        "change", client_of(scope), scope["method"], scope["path"], message["status"]
                    )
            await send(message)

        return finished

    async def _refuse(self, scope: Scope, send: Send, refusal: ApiError) -> None:
        method = scope.get("method", "WEBSOCKET")
        self._audit.record(
            "refused", client_of(scope), method, scope["path"], refusal.status_code, refusal.code
        )
        kind = "http.response" if scope["type"] == "http" else "websocket.http.response"
        if kind.startswith("websocket") and "websocket.http.response" not in scope.get("extensions", {}):
            await send({"type": "websocket.close", "code": 1008, "reason": refusal.code})
            return
        body = b"" if method == "HEAD" else body_of(refusal)
        start: Message = {"type": f"{kind}.start", "status": refusal.status_code, "headers": []}
        headers = MutableHeaders(raw=start["headers"])
        headers.update({"content-type": MEDIA_TYPE, "content-length": str(len(body_of(refusal)))})
        # What was not read of the body would be taken for the next request.
        headers.update({**(refusal.headers or {}), "connection": "close"})
        _complete(start, scope["path"])
        await send(start)
        await send({"type": f"{kind}.body", "body": body})


def _caller(scope: Scope) -> Caller:
    websocket = scope["type"] == "websocket"
    method = "GET" if websocket else scope["method"]
    return Caller(method, is_public(scope["path"], method), tuple(scope["headers"]), websocket)


def is_public(path: str, method: str) -> bool:
    """Whether `path` is one of the page's own files, which hold no data; everything else needs a token."""
    return method in SAFE_METHODS and (path in PUBLIC_FILES or path.startswith(PUBLIC_FOLDER))


def client_of(scope: Scope) -> str:
    """Return the peer's address; headers such as X-Forwarded-For are not believed."""
    client = scope.get("client")
    return client[0] if client else "local"


def _complete(message: Message, path: str) -> None:
    headers = MutableHeaders(raw=message["headers"])
    for name, value in headers_for(path).items():
        headers.setdefault(name, value)


def _too_many(wait_s: float) -> ApiError:
    cause = f"More requests came than this service answers; there is room again in {wait_s:.1f} s."
    return ApiError("rate_limited", cause, headers={"Retry-After": str(int(wait_s) + 1)})


def _too_large(limit: int) -> ApiError:
    return ApiError("too_large", f"The body is larger than the {limit:,} bytes that are accepted here.")
