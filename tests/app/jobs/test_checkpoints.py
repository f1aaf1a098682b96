from pathlib import Path

import pytest

from app.jobs.checkpoints import FolderStore
from core.checkpoint import claim, keep


def test_a_folder_keeps_blobs_by_name_for_the_next_process(tmp_path: Path):
    store = FolderStore(tmp_path / "made later")
    assert dict(store) == {}
    store["one"], store["two"] = b"1", b"2"
    store["one"] = b"uno"

    again = FolderStore(tmp_path / "made later")
    assert dict(again) == {"one": b"uno", "two": b"2"}
    del again["one"]
    with pytest.raises(KeyError):
        again["one"]
    with pytest.raises(KeyError):
        del again["one"]
    again.clear()
    assert len(store) == 0


def test_a_file_that_is_still_being_written_is_not_there(tmp_path: Path):
    (tmp_path / ".one.123.tmp.checkpoint").write_bytes(b"half")
    assert len(FolderStore(tmp_path)) == 0


def test_the_newest_two_checkpoints_are_kept_beside_what_else_there_is(tmp_path: Path):
    store = FolderStore(tmp_path)
    claim(store, "whose")
    for content in (b"one", b"two", b"three"):
        keep(store, content)
    assert dict(store) == {"00000002": b"two", "00000003": b"three", "configuration": b"whose"}
    keep(FolderStore(tmp_path), b"four")
    assert dict(store) == {"00000003": b"three", "00000004": b"four", "configuration": b"whose"}
