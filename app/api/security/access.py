"""Who may pass: pure rules over one request's headers, the same for HTTP and WebSocket.

Each rule answers a known attack: Host against DNS rebinding, Origin and Sec-Fetch-Site against other pages
(also those on other ports of this machine, which SameSite does not see), the token against other users.
"""

import hmac
from dataclasses import dataclass

from app.api.security.sessions import Sessions
from app.api.security.settings import ServiceConfig
from app.api.wire.problems import ApiError

SAFE_METHODS = frozenset({"GET", "HEAD"})
BEARER = b"bearer "


@dataclass(frozen=True)
class Caller:
    """What one request says of itself. `public` paths hold no data: the page's own files."""

    method: str
    public: bool
    headers: tuple[tuple[bytes, bytes], ...]
    websocket: bool = False

    def values(self, name: bytes) -> list[bytes]:
        """Every value of header `name`; a repeated header is a trick, so rules want exactly one."""
        return [value for key, value in self.headers if key.lower() == name]


class Access:
    """The rules for one service's hosts, origins and token."""

    def __init__(self, config: ServiceConfig) -> None:
        self._hosts = frozenset(host.encode() for host in config.hosts)
        self._origins = frozenset(origin.encode() for origin in config.origins)
        self._token = config.token.encode()
        self._cookie_name = config.cookie_name.encode()
        limits, kept = config.limits, config.data_root / "service" / "sessions.json"
        self.sessions = Sessions(kept, config.token, limits.session_idle_s, limits.session_s)

    def refusal(self, caller: Caller) -> ApiError | None:
        """Return why `caller` may not pass, or None."""
        return self._host(caller) or self._origin(caller) or self._token_or_cookie(caller)

    def _host(self, caller: Caller) -> ApiError | None:
        hosts = caller.values(b"host")
        if len(hosts) == 1 and hosts[0].lower() in self._hosts:
            return None
        return ApiError("host_refused", "The request names a host that this service does not serve.")

    def _origin(self, caller: Caller) -> ApiError | None:
        origins = caller.values(b"origin")
        sites = caller.values(b"sec-fetch-site")
        good_sites = {b"same-origin", b"none"} if self._is_safe(caller) else {b"same-origin"}
        foreign = len(origins) > 1 or any(origin not in self._origins for origin in origins)
        if foreign or len(sites) > 1 or any(site not in good_sites for site in sites):
            return ApiError("origin_refused", "The request comes from another page than the service's own.")
        return None

    def _token_or_cookie(self, caller: Caller) -> ApiError | None:
        if caller.public:
            return None
        offered = caller.values(b"authorization")
        if offered:
            good = len(offered) == 1 and self._bearer_matches(offered[0])
            return None if good else _no_token("The token is not the one of this service.")
        if not self._has_session(caller):
            return _no_token("The request carries no valid token or session.")
        if not self._is_safe(caller) and not caller.values(b"origin"):
            return ApiError("origin_refused", "A change by session cookie must say which page it comes from.")
        return None

    def _is_safe(self, caller: Caller) -> bool:
        return caller.method in SAFE_METHODS and not caller.websocket

    def _bearer_matches(self, value: bytes) -> bool:
        scheme, token = value[: len(BEARER)], value[len(BEARER) :]
        return scheme.lower() == BEARER and hmac.compare_digest(token, self._token)

    def still(self, caller: Caller) -> bool:
        """Whether who passed by a session may go on with an answer that has no end."""
        return bool(caller.values(b"authorization")) or self._has_session(caller, use=False)

    def _has_session(self, caller: Caller, use: bool = True) -> bool:
        found = [
            value.strip()
            for line in caller.values(b"cookie")
            for name, _, value in (part.partition(b"=") for part in line.split(b";"))
            if name.strip() == self._cookie_name
        ]
        hosts = caller.values(b"host")
        if len(found) != 1 or len(hosts) != 1:
            return False
        return self.sessions.is_open(found[0].decode("latin-1"), hosts[0].decode("latin-1"), use)


def _no_token(cause: str) -> ApiError:
    return ApiError("token_missing", cause, headers={"WWW-Authenticate": 'Bearer realm="airlens"'})
