"""A full disk at some write of a run; all of them: tests/benchmarks/disk_full.py."""

import shutil
from pathlib import Path

import pytest

from tests.powercut.story import live_on_a_full_disk, mounted, specs, undisturbed

pytestmark = pytest.mark.skipif(
    not Path("/dev/fuse").exists() or shutil.which("fusermount3") is None,
    reason="needs /dev/fuse and fusermount3 (apt-get install fuse3)",
)


def test_a_full_disk_is_told_damages_nothing_and_the_job_goes_on_when_it_is_freed(tmp_path: Path):
    wanted = specs(count=1, trials=400)
    # Well after the ledger was made (about 60 writes): in the worker's checkpoints or the ledger's events.
    with mounted(tmp_path) as (mount, _):
        lived = live_on_a_full_disk(mount, wanted, writes=110)
    assert lived["told"] != []
    assert not lived["damage"]
    assert lived["results"] == undisturbed(tmp_path / "undisturbed", wanted)
