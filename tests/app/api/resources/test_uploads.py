"""Uploads through the live service: what is sound is kept, what is not leaves nothing behind."""

import io
from pathlib import Path

import numpy as np
import pytest
import tifffile

from tests.app.api.conftest import Live, is_problem
from tests.app.files.uploads.test_declared import BOMBS

OCTETS = {"Content-Type": "application/octet-stream"}


def kept(live: Live) -> list[Path]:
    return [path for path in (live.config.data_root / "uploads").rglob("*") if path.is_file()]


@pytest.mark.parametrize("name", BOMBS)
def test_a_refused_file_leaves_nothing(live: Live, name: str):
    before = kept(live)
    with live.client() as client:
        answer = client.post("/api/uploads", content=BOMBS[name], headers=OCTETS)
    assert is_problem(answer, "content_refused")
    assert kept(live) == before


def test_a_sound_file_is_read_listed_and_deleted(live: Live):
    image = np.linspace(0, 1, 600, dtype=np.float32).reshape(20, 30)
    packed = io.BytesIO()
    tifffile.imwrite(packed, np.stack([image, 0.1 * image]), compression="zlib")
    with live.client() as client:
        upload = client.post("/api/uploads", content=packed.getvalue(), headers=OCTETS).json()
        assert [array["shape"] for array in upload["arrays"]] == [[20, 30], [20, 30]]
        assert upload in client.get("/api/uploads").json()
        stored = live.config.data_root / "uploads" / upload["upload"] / "page0.npy"
        assert np.array_equal(np.load(stored, allow_pickle=False), image)
        assert client.delete(f"/api/uploads/{upload['upload']}").status_code == 204
        assert client.get("/api/uploads").json() == []
    assert not stored.exists()


def test_a_damaged_file_with_a_good_header_is_refused_by_the_child(live: Live):
    packed = io.BytesIO()
    tifffile.imwrite(packed, np.zeros((64, 64), np.uint16), compression="zlib")
    content = bytearray(packed.getvalue())
    at = content.index(b"\x78\x9c")
    content[at : at + 40] = b"\xff" * 40
    with live.client() as client:
        assert is_problem(
            client.post("/api/uploads", content=bytes(content), headers=OCTETS), "content_refused"
        )
