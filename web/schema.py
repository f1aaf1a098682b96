"""Writes `src/lib/schema.ts`, the API's types, from the service's own OpenAPI description: `make types`."""

import hashlib
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from app.api.factory import create_app
from app.api.security.settings import new_token, service_config

WEB = Path(__file__).resolve().parent
SCHEMA = WEB / "src" / "lib" / "schema.ts"
OPTIONS = ("--root-types", "--root-types-no-schema-prefix", "--default-non-nullable=false")


def description() -> dict[str, Any]:
    """Return what the service says that it offers."""
    with tempfile.TemporaryDirectory() as folder:
        return create_app(service_config(Path(folder), new_token(), 8765)).openapi()


def seal(described: dict[str, Any], types: str) -> str:
    """Return a hash over a description (without the program's version) and the types made from it."""
    content = json.dumps({key: value for key, value in described.items() if key != "info"}, sort_keys=True)
    return hashlib.sha256(f"{content}\0{types}".encode()).hexdigest()


def header(described: dict[str, Any], types: str) -> str:
    """Return the first line of the file: how it is made, and the seal that a test checks."""
    return f"// Made by `make types`, never by hand. sha256 {seal(described, types)}\n"


def main() -> int:
    """Generate the types with openapi-typescript, by PyPI's Node.js."""
    sys.path.insert(0, str(WEB))
    from hatch_build import install, node

    described = description()
    install()
    with tempfile.TemporaryDirectory() as folder:
        told, made = Path(folder) / "openapi.json", Path(folder) / "schema.ts"
        told.write_text(json.dumps(described, sort_keys=True), encoding="utf-8")
        node("npm", "run", "types", "--", str(told), *OPTIONS, "--output", str(made))
        types = made.read_text(encoding="utf-8")
    SCHEMA.write_text(header(described, types) + types, encoding="utf-8")
    sys.stdout.write(f"Written: {SCHEMA.relative_to(WEB.parent)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
