"""What a file or a result came from: hashes, versions, device."""

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


def provenance(inputs: dict[str, Path]) -> dict[str, Any]:
    """Date, hashes of the input files, package versions, and the machine's device."""
    import jax

    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "inputs": {name: {"file": path.name, "sha256": sha256(path)} for name, path in inputs.items()},
        "versions": {"python": platform.python_version()}
        | {name: importlib.metadata.version(name) for name in _PACKAGES},
        "device": str(jax.devices()[0]),
        "machine": platform.machine(),
    }
