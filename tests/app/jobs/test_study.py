import json
import statistics
import threading
from pathlib import Path

import pytest

from app import worker
from app.errors import BadInputError
from app.jobs import JobSpec, JobState, Ledger, submit_ensemble, submit_sweep, summarise
from app.jobs.dispatch import Dispatch
from app.jobs.folder import JobFolder
from app.jobs.state import JobEvent
from app.jobs.study import keep_summary

SMALL = {"trials": 8, "size_px": 64}


def run_all(ledger: Ledger) -> None:
    dispatch = Dispatch(ledger)
    for job in ledger.jobs(states=[JobState.queued]):
        owner = dispatch.begin(job.id, "cpu:0", "local")
        assert owner is not None
        folder = JobFolder(ledger.folder_of(job.id))
        folder.hand_over(owner)
        worker.compute(folder, owner, threading.Event())
        dispatch.move(ledger.get(job.id), JobEvent.finish)


def test_more_light_means_less_noise_and_the_summary_shows_it(tmp_path: Path):
    ledger = Ledger(tmp_path)
    axes = {"electrons": [10000.0, 40000.0], "frames": [1, 4]}
    spec = JobSpec(kind="noise-study", settings={**SMALL, "trials": 40, "read_noise_electrons": 0.0})
    group, jobs = submit_sweep(ledger, spec, axes)
    assert [job.title for job in jobs][:2] == ["electrons=10000.0, frames=1", "electrons=10000.0, frames=4"]
    run_all(ledger)

    summary = summarise(ledger, group.id)

    assert summary.states == {"done": 4}
    scatter = [point.numbers["scatter_px"] for point in summary.points]
    # Shot noise falls with the root of the light; 40 trials of 16 windows tell a scatter to about 3 %.
    assert scatter[0] / scatter[1] == pytest.approx(2, rel=0.12)
    assert scatter[0] / scatter[3] == pytest.approx(4, rel=0.12)
    assert summary.spread["scatter_px"].most == max(scatter)


def test_an_ensemble_differs_in_its_seed_alone(tmp_path: Path):
    ledger = Ledger(tmp_path)
    group, _ = submit_ensemble(ledger, JobSpec(kind="noise-study", settings={**SMALL, "seed": 5}), members=3)
    run_all(ledger)
    keep_summary(ledger, group.id)

    summary = json.loads((tmp_path / "groups" / f"{group.id}.json").read_text())

    assert [point["settings"] for point in summary["points"]] == [{"seed": 5}, {"seed": 6}, {"seed": 7}]
    values = [point["numbers"]["bias_px"] for point in summary["points"]]
    assert len(set(values)) == 3
    assert summary["spread"]["bias_px"]["std"] == pytest.approx(statistics.stdev(values))


def test_a_sweep_with_one_bad_value_queues_nothing(tmp_path: Path):
    ledger = Ledger(tmp_path)
    with pytest.raises(BadInputError, match="electrons"):
        submit_sweep(ledger, JobSpec(kind="noise-study"), {"electrons": [1000.0, -1.0]})
    with pytest.raises(BadInputError, match="0 jobs"):
        submit_sweep(ledger, JobSpec(kind="noise-study"), {"electrons": []})
    assert ledger.jobs() == []
    assert ledger.groups() == []
