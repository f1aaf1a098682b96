import json
import threading
from pathlib import Path

import numpy as np
import pytest

from app import worker
from app.errors import BadInputError
from app.experiment.results import read_result
from app.jobs import JobSpec, Ledger
from app.jobs.attempt import PLANE_FILE, AttemptStoppedError
from app.jobs.folder import JobFolder, Owner
from app.jobs.told import whole_lines
from app.pipeline import reconstruct
from app.plan.runs import kept_runs


def begun(ledger: Ledger, experiment: Path) -> tuple[JobFolder, Owner]:
    job = ledger.submit(JobSpec(kind="reconstruct", experiment=experiment, settings={"preset": "draft"}))
    folder, owner = JobFolder(ledger.folder_of(job.id)), Owner(1, "first")
    folder.hand_over(owner)
    return folder, owner


def test_a_job_gives_the_result_of_the_pipeline_bit_for_bit(experiment: Path, tmp_path: Path):
    directly = read_result(reconstruct(experiment, "draft").folder / "result.nc")
    folder, owner = begun(Ledger(tmp_path), experiment)

    worker.compute(folder, owner, threading.Event())

    found = read_result(folder.target() / "result.nc")
    assert found.temperature_k.tobytes() == directly.temperature_k.tobytes()
    assert folder.target().parent == experiment / "results"
    assert folder.target().name in (folder.target() / "report.html").read_text()
    assert [path for path in (experiment / "results").iterdir() if path.name.startswith(".")] == []
    # What it showed while it ran: the middle plane of the growing field.
    plane = np.load(folder.attempt(1) / PLANE_FILE)
    assert plane.shape == (found.temperature_k.shape[0], found.temperature_k.shape[2])
    final = found.temperature_k[:, found.temperature_k.shape[1] // 2]
    assert np.corrcoef(plane.ravel(), final.ravel())[0, 1] > 0.999


def test_a_job_tells_how_long_yet_and_promises_are_learned_from_it(
    experiment: Path, tmp_path: Path, monkeypatch
):
    monkeypatch.setenv("AIRLENS_MACHINE", str(tmp_path / "machine.json"))
    folder, owner = begun(Ledger(tmp_path / "jobs"), experiment)
    worker.compute(folder, owner, threading.Event())

    lines, _ = whole_lines(folder.attempt(1) / "events.jsonl", 0)
    events = [json.loads(line) for line in lines]
    told = {event["body"]["stage"]: event["body"] for event in events if event["kind"] == "stage"}
    assert told["solve (draft)"]["left_s"] > told["report"]["left_s"] >= 0.0
    assert all(event["body"]["left_s"] >= 0.0 for event in events if event["kind"] == "progress")
    (run,) = kept_runs()
    assert run.preset == "draft"
    assert {"start", "read", "measure", "solve", "report"} <= set(run.seconds)


def test_a_stopped_job_leaves_no_result_and_an_order_without_experiment_is_refused(
    experiment: Path, tmp_path: Path
):
    ledger, stop = Ledger(tmp_path), threading.Event()
    folder, owner = begun(ledger, experiment)
    stop.set()
    known = kept_runs()
    with pytest.raises(AttemptStoppedError):
        worker.compute(folder, owner, stop)
    assert not folder.is_published()
    assert kept_runs() == known
    with pytest.raises(BadInputError, match="works on an experiment"):
        ledger.submit(JobSpec(kind="reconstruct"))
    with pytest.raises(BadInputError, match="holds no experiment"):
        ledger.submit(JobSpec(kind="reconstruct", experiment=tmp_path))
