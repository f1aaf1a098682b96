"""The audit log: who asked to change what, and who was refused; never a token, cookie, header or query."""

import json
import os
import time
from pathlib import Path

LARGEST_BYTES = 16 << 20


class AuditLog:
    """One JSON line an entry, appended; the previous file is kept when one grows over 16 MiB."""

    def __init__(self, path: Path) -> None:
        self._path = path
        path.parent.mkdir(parents=True, exist_ok=True)

    def record(self, event: str, client: str, method: str, path: str, status: int, code: str = "") -> None:
        """Append one entry; a full disk must not stop the service, so a failed write is dropped."""
        entry = {
            "time_s": round(time.time(), 3),
            "event": event,
            "client": client,
            "method": method,
            # A path can hold a mistyped token; what is not an address of ours is cut short.
            "path": path[:80] if path.startswith("/api/") else path[:24],
            "status": status,
            "code": code,
        }
        line = (json.dumps(entry) + "\n").encode()
        try:
            self._rotate()
            descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            try:
                os.write(descriptor, line)
            finally:
                os.close(descriptor)
        except OSError:
            return

    def _rotate(self) -> None:
        if self._path.exists() and self._path.stat().st_size > LARGEST_BYTES:
            self._path.replace(self._path.with_suffix(".old.jsonl"))
