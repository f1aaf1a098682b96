"""What a file or a result came from: its hash, versions, device."""

import hashlib
import importlib.metadata
import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

_PACKAGES = ("airlens", "jax", "numpy", "scipy", "opencv-contrib-python-headless", "equinox", "optax")


def sha256(path: Path) -> str:
    """Hex SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def provenance() -> dict[str, Any]:
    """Date, package versions, and the machine's device."""
    import jax

    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version()}
        | {name: importlib.metadata.version(name) for name in _PACKAGES},
        "device": str(jax.devices()[0]),
        "machine": platform.machine(),
    }
