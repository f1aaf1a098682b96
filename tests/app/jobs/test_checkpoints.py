from pathlib import Path

from app.jobs.checkpoints import FolderStore


def test_two_are_kept_newest_first_also_for_the_next_attempt(tmp_path: Path):
    store = FolderStore(tmp_path)
    assert store.load() == []
    for content in (b"one", b"two", b"three"):
        store.save(content)
    assert store.load() == [b"three", b"two"]

    again = FolderStore(tmp_path)
    again.save(b"four")
    assert again.load() == [b"four", b"three"]
    assert len(list(tmp_path.iterdir())) == 2
