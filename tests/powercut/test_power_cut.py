"""Power cuts on a file system of our own. All 200 of them: tests/benchmarks/power_cut.py."""

import random
import shutil
from pathlib import Path

import pytest

from tests.powercut.story import losses_after_cut, record, specs, undisturbed

pytestmark = pytest.mark.skipif(
    not Path("/dev/fuse").exists() or shutil.which("fusermount3") is None,
    reason="needs /dev/fuse and fusermount3 (apt-get install fuse3)",
)


@pytest.fixture(scope="module")
def lived(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[dict], dict]:
    """The trace of one story of jobs and captures, and the results that it must come to."""
    folder = tmp_path_factory.mktemp("lived")
    wanted = specs(count=2, trials=60)
    return record(folder, wanted), undisturbed(folder / "undisturbed", wanted)


def test_a_power_cut_at_any_moment_loses_nothing_that_was_acknowledged(lived: tuple[list[dict], dict]):
    trace, expected = lived
    chance = random.Random(0)
    for _ in range(12):
        at, seed = chance.randint(0, len(trace)), chance.random()
        assert losses_after_cut(trace, at, seed, expected) == []


def test_the_file_system_does_forget_what_was_not_flushed(lived: tuple[list[dict], dict]):
    trace, expected = lived
    careless = [change for change in trace if not change["op"].startswith("fsync")]
    assert losses_after_cut(careless, len(careless), 0, expected) != []
