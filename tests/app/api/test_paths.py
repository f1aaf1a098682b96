"""No name leads out of the data root: folders are found by listing, whatever is asked."""

import contextlib
import http.client
import json
import random
from pathlib import Path
from urllib.parse import quote

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.api.folders import child
from tests.app.api.conftest import Live

PIECES = [
    *("..", ".", "/", "\\", "\0", "real", "real-secret", "link", "%2e%2e", "~"),
    *("é", "e\u0301", "\u2025", "\uff0f", "\u202e", " ", "\n", "REAL", "\ud800"),
]
NAMES = st.one_of(st.lists(st.sampled_from(PIECES), max_size=6).map("".join), st.text(max_size=40))
KNOWN = [
    *("..", ".", "../real-secret", "real/../../real-secret", "/etc", "/etc/passwd", "real\0", "real/"),
    *("./real", "real-secret", "REAL", "link", "real ", " real", "..\\real", "con", "~", "~root", ""),
    *("real%00", "\u202ereal"),
]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root with one real folder, a sibling with the same prefix, and a link that leads out."""
    base = tmp_path_factory.mktemp("base")
    for name in ("root/real", "root-secret", "real-secret"):
        (base / name).mkdir(parents=True)
        (base / name / "experiment.toml").write_text("title = 'x'")
    (base / "root" / "link").symlink_to(base / "real-secret")
    (base / "root" / "file").write_text("x")
    return base / "root"


def check(root: Path, name: str) -> None:
    found = child(root, name)
    assert found is None or (name == "real" and found == root / "real")


@settings(max_examples=300, deadline=None)
@given(name=NAMES)
def test_no_generated_name_escapes(root: Path, name: str):
    check(root, name)


def test_ten_thousand_combinations_find_the_real_folder_or_nothing(root: Path):
    draw = random.Random(8)
    for _ in range(10_000):
        check(root, "".join(draw.choices(PIECES, k=draw.randint(0, 6))))


@pytest.mark.parametrize("name", KNOWN)
def test_known_tricks_find_nothing(root: Path, name: str):
    assert child(root, name) is None


@pytest.mark.parametrize("name", KNOWN)
def test_the_service_answers_tricks_with_a_problem(live: Live, name: str):
    paths = [f"/api/experiments/{quote(name, safe='')}", f"/api/experiments/x/results/{quote(name)}"]
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", live.port, timeout=100)) as connection:
        for path in paths:
            connection.request("GET", path, headers=live.bearer)
            answer = connection.getresponse()
            body = json.loads(answer.read())
            assert answer.status in (404, 405, 422)
            assert body["status"] == answer.status
