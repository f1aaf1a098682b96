"""Curves: thinned evenly, with their last point, and each event read once."""

from pathlib import Path

import pytest

from app.api.wire.curves import CurveCache
from app.jobs import JobSpec, Ledger


@pytest.fixture
def ledger(tmp_path: Path) -> Ledger:
    return Ledger(tmp_path)


def tell(ledger: Ledger, job: str, steps: range) -> None:
    for step in steps:
        ledger.append_event("progress", {"step": step, "steps": 50, "loss": 1.0 / (step + 1)}, job=job)


def test_curves_are_thinned_with_their_first_and_last_point(ledger: Ledger):
    job = ledger.submit(JobSpec(kind="noise-study")).id
    tell(ledger, job, range(50))
    steps, values = CurveCache(ledger).read(job, 10)
    assert (steps[0], steps[-1]) == (0, 49)
    assert 8 <= len(steps) <= 10
    assert values == {"loss": [1.0 / (step + 1) for step in steps]}


def test_how_long_yet_is_of_a_moment_and_no_curve(ledger: Ledger):
    job = ledger.submit(JobSpec(kind="noise-study")).id
    ledger.append_event("progress", {"step": 1, "steps": 50, "loss": 1.0, "left_s": 9.0}, job=job)
    assert set(CurveCache(ledger).read(job, 10)[1]) == {"loss"}


def test_what_is_told_later_is_added(ledger: Ledger):
    job = ledger.submit(JobSpec(kind="noise-study")).id
    cache = CurveCache(ledger)
    assert cache.read(job, 10) == ([], {})
    tell(ledger, job, range(3))
    assert cache.read(job, 10)[0] == [0, 1, 2]
    ledger.append_event("progress", {"step": 2, "steps": 50, "loss": None}, job=job)
    tell(ledger, job, range(3, 5))
    assert cache.read(job, 10)[1]["loss"][2:] == [None, 0.25, 0.2]
