"""Whatever the page can do, a program and a shell can do too: a table made from their sources."""

import inspect
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from fastapi import FastAPI

from app.api.factory import create_app
from app.api.security.settings import new_token, service_config
from app.commands.remote import requests

SOURCES = Path(__file__).resolve().parents[2] / "web" / "src"


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> FastAPI:
    return create_app(service_config(tmp_path_factory.mktemp("data"), new_token(), 8765))


def shape(path: str) -> tuple[str, ...]:
    """A path with every variable part replaced by *."""
    return tuple("*" if "{" in part else part for part in path.strip("/").split("/"))


def described(app: FastAPI) -> dict[tuple[str, tuple[str, ...]], str]:
    return {
        (method.upper(), shape(path.removeprefix("/api"))): f"{method.upper()} {path}"
        for path, item in app.openapi()["paths"].items()
        for method in item
    }


def asked_by_the_page() -> set[tuple[str, tuple[str, ...]]]:
    """Every request in the page's sources: written as described, `"GET /jobs/{job}"`, and typed by that."""
    found = set()
    for file in SOURCES.rglob("*"):
        if file.suffix in (".ts", ".svelte") and file.name != "schema.ts":
            text = file.read_text(encoding="utf-8")
            written = re.findall(r'"(GET|POST|PUT|PATCH|DELETE) (/[^"]+)"', text)
            found |= {(method, shape(path)) for method, path in written}
    return found


def asked_by_the_client() -> set[tuple[str, tuple[str, ...]]]:
    return {asked for method in requests().values() for asked in asked_by(method)}


def asked_by(method: Callable) -> set[tuple[str, tuple[str, ...]]]:
    text = inspect.getsource(method)
    paths = re.findall(r"""f?"(/[^"]*)\"""", text)
    verb = re.search(r'"(GET|POST|PUT|PATCH|DELETE)"', text)
    if "self._http.delete" in text:
        name = "DELETE"
    elif "self._http.post" in text:
        name = "POST"
    else:
        name = verb.group(1) if verb else "GET"
    return {(name, shape(path)) for path in paths}


def matches(wanted: tuple[str, ...], offered: tuple[str, ...]) -> bool:
    """Whether a request fits a described path: literal parts are equal, variable ones may be anything."""
    return len(wanted) == len(offered) and all(b in ("*", a) for a, b in zip(wanted, offered, strict=True))


def test_every_request_of_the_page_is_described(app: FastAPI):
    asked = asked_by_the_page()
    assert len(asked) >= 20
    for method, path in asked:
        assert any(m == method and matches(path, p) for m, p in described(app)), (method, path)


def test_every_operation_is_in_the_client_and_so_in_the_shell(app: FastAPI):
    asked = asked_by_the_client()
    browsers_own = {("POST", ("session",)), ("DELETE", ("session",))}
    mjpeg = ("GET", shape("/devices/camera/live.mjpeg"))
    for key, operation in described(app).items():
        if key in browsers_own or key == mjpeg:
            continue
        assert any(key[0] == m and matches(p, key[1]) for m, p in asked), f"the client lacks {operation}"


def table(app: FastAPI) -> list[tuple[str, str, str]]:
    """Every request of the page: the API's operation, the client's method, the line for a shell."""
    offered, methods = described(app), {name: asked_by(method) for name, method in requests().items()}
    rows = []
    for verb, path in sorted(asked_by_the_page()):
        if path[:1] == ("session",):
            continue  # a browser's own: the cookie
        operation = next((o for (m, p), o in offered.items() if m == verb and matches(path, p)), "")
        method = next(
            (n for n, asked in methods.items() if any(m == verb and matches(p, path) for m, p in asked)), ""
        )
        rows.append((operation, method, f"airlens remote {method}" if method else ""))
    return rows


def test_every_action_of_the_page_has_its_operation_its_method_and_its_line(app: FastAPI):
    rows = table(app)
    assert len(rows) >= 30
    assert [row for row in rows if not all(row)] == []


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        for row in table(create_app(service_config(Path(folder), new_token(), 8765))):
            sys.stdout.write("| " + " | ".join(f"`{cell}`" for cell in row) + " |\n")
