"""A short form of the chaos that tests/benchmarks/chaos.py spreads at length."""

from pathlib import Path

from tests.benchmarks.chaos import chaos


def test_kills_at_random_moments_lose_double_and_tear_nothing(tmp_path: Path):
    counts = chaos(tmp_path.resolve(), jobs=2, kills=6, trials=300, pause_s=1.5, seed=1, limit_s=200)
    assert counts["kills"] == 6
    assert {name: counts[name] for name in ("lost", "doubled", "half_written", "leftovers", "unequal")} == {
        "lost": 0,
        "doubled": 0,
        "half_written": 0,
        "leftovers": 0,
        "unequal": 0,
    }
    assert counts["equal"] == 2
    assert counts["jobs_seen_with_two_workers"] == 0
