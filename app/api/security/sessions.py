"""Sessions of browsers: random, known here by their hash only, bound to the host they were opened at, and ended.

A session ends by logging out, when nobody used it for a while, at its greatest age, with a new token, and when
too many others were opened since. A restart of the service keeps it, with a fresh time of rest.
"""

import contextlib
import hashlib
import hmac
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.errors import BadInputError
from app.files.durable import write_json
from app.files.reading import read_json

MOST = 64


@dataclass
class _Session:
    host: str
    opened_s: float
    used_s: float


class Sessions:
    """The open sessions of one token; `path` keeps them over a restart.

    Age is told by the wall clock, which goes on while the service does not run; rest by the monotonic one.
    """

    def __init__(
        self,
        path: Path,
        token: str,
        idle_s: float,
        longest_s: float,
        now_s: Callable[[], float] = time.time,
        rest_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._token = path, token.encode()
        self._idle_s, self._longest_s = idle_s, longest_s
        self._now_s, self._rest_s = now_s, rest_s
        self._lock = threading.Lock()
        self._open = self._kept()

    def open(self, host: str) -> str:
        """Return the secret of a new session at `host`, as the browser sends it (`name:port`)."""
        secret = secrets.token_urlsafe(32)
        with self._lock:
            self._open[self._name(secret)] = _Session(host.lower(), self._now_s(), self._rest_s())
            while len(self._open) > MOST:
                del self._open[next(iter(self._open))]
            self._keep()
        return secret

    def is_open(self, secret: str, host: str, use: bool = True) -> bool:
        """Whether the session is open at this host; `use` ends its rest."""
        name = self._name(secret)
        with self._lock:
            session = self._open.get(name)
            if session is None or session.host != host.lower():
                return False
            age_s, rest_s = self._now_s() - session.opened_s, self._rest_s() - session.used_s
            # A session from the future was opened by a wrong clock, so that its age is not known.
            if not -60 <= age_s <= self._longest_s or rest_s > self._idle_s:
                del self._open[name]
                return False
            if use:
                session.used_s = self._rest_s()
            return True

    def close(self, secret: str) -> None:
        """End a session for every browser and program that has its secret."""
        with self._lock:
            if self._open.pop(self._name(secret), None) is not None:
                self._keep()

    def _name(self, secret: str) -> str:
        # With the token, so that a new token ends every session.
        return hmac.new(self._token, secret.encode("utf-8", "replace"), hashlib.sha256).hexdigest()

    def _keep(self) -> None:
        lines = {name: {"host": s.host, "opened_s": s.opened_s} for name, s in self._open.items()}
        with contextlib.suppress(OSError):  # on a full disk a session lasts until the next restart
            write_json(self._path, lines)

    def _kept(self) -> dict[str, _Session]:
        found: dict[str, Any] = {}
        if self._path.exists():
            with contextlib.suppress(BadInputError):  # damaged: everybody opens the printed address again
                found = read_json(self._path, "")
        return {
            name: _Session(str(line["host"]), float(line["opened_s"]), self._rest_s())
            for name, line in found.items()
            if isinstance(line, dict) and isinstance(line.get("opened_s"), float) and "host" in line
        }
