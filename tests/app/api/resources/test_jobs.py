"""Jobs through the client: submit, follow, stop, go on; every refusal says why."""

import threading
from collections.abc import Iterator

import pytest

from app.client import Client, ServiceError
from app.jobs import Supervisor, read_config
from tests.app.api.conftest import Live

STUDY = {"trials": 40, "size_px": 64}


@pytest.fixture(scope="module")
def airlens(airlens: Client, live: Live) -> Iterator[Client]:
    """With a supervisor beside the service."""
    stop = threading.Event()
    ledger = live.app.state.services.ledger
    supervisor = Supervisor(ledger, read_config(live.config.jobs_folder))
    thread = threading.Thread(target=supervisor.run, args=(stop,))
    thread.start()
    yield airlens
    stop.set()
    thread.join()


def test_a_job_is_queued_run_and_its_curves_are_read(airlens: Client):
    job = airlens.submit_job("noise-study", STUDY, title="a study")
    assert job.state == "queued"
    done = airlens.wait(job.job, limit_s=200, every_s=0.1)
    assert (done.state, done.step, done.progress) == ("done", 40, 1.0)
    curves = airlens.curves(job.job)
    assert curves.step[-1] == 40
    assert len(curves.values["scatter_px"]) == len(curves.step)
    assert job.job in [listed.job for listed in airlens.jobs(state="done")]


def test_a_job_that_could_only_fail_is_not_queued(airlens: Client):
    experiment = airlens.create_experiment(camera_px=64).experiment
    with pytest.raises(ServiceError, match="There is no preset 'nope'; known: auto, draft") as refused:
        airlens.submit_job("reconstruct", {"preset": "nope"}, experiment=experiment)
    assert refused.value.problem.code == "bad_input"


def test_a_value_that_is_none_is_named_as_its_sender_knows_it(live: Live):
    with live.client() as http:
        told = http.post("/api/jobs", json={"kind": "noise-study", "priority": "high"}).json()
    assert told["cause"].startswith("Not accepted: priority (")
    assert told["errors"][0]["field"] == "body.priority"


def test_the_same_key_gives_the_same_job(airlens: Client):
    first = airlens.submit_job("noise-study", STUDY, key="a-key-of-mine")
    assert airlens.submit_job("noise-study", STUDY, key="a-key-of-mine").job == first.job


def test_a_job_is_cancelled_and_retried_to_its_end(airlens: Client):
    job = airlens.submit_job("noise-study", {"trials": 100_000, "size_px": 64}, priority=5).job
    airlens.act_on_job(job, "cancel")
    assert airlens.wait(job, limit_s=200, every_s=0.1).state == "cancelled"
    assert airlens.act_on_job(job, "retry").state == "queued"
    airlens.act_on_job(job, "cancel")
    assert airlens.wait(job, limit_s=200, every_s=0.1).state == "cancelled"


@pytest.mark.parametrize(
    ("kind", "settings", "code"),
    [("no-such-kind", {}, "bad_input"), ("noise-study", {"trials": -1}, "bad_input")],
)
def test_a_job_that_cannot_run_is_refused_at_once(airlens: Client, kind: str, settings: dict, code: str):
    with pytest.raises(ServiceError) as caught:
        airlens.submit_job(kind, settings)
    assert caught.value.problem.code == code


def test_an_unknown_job_and_an_impossible_request_are_told_apart(airlens: Client):
    with pytest.raises(ServiceError) as caught:
        airlens.job("j-none")
    assert caught.value.problem.code == "not_found"
    done = airlens.jobs(state="done")[0].job
    with pytest.raises(ServiceError) as caught:
        airlens.act_on_job(done, "resume")
    assert caught.value.problem.code == "conflict"


def test_places_are_read_from_a_job_that_found_them(airlens: Client):
    (answers,) = (one.answers for one in airlens.templates() if one.template == "empty")
    study = airlens.submit_job("noise-study", STUDY).job
    job = airlens.submit_job("places", {"answers": answers}, title="Places of the camera").job
    assert airlens.wait(job, limit_s=500, every_s=0.5).state == "done"
    found = airlens.places(job)
    assert len(found.x_m) * len(found.y_m) == 49
    with pytest.raises(ServiceError, match="has found no places"):
        airlens.places(study)
