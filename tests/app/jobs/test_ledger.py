import threading
from dataclasses import replace
from pathlib import Path

import pytest

from app.errors import BadInputError
from app.jobs.errors import JobError, UnknownJobError
from app.jobs.ledger import Ledger
from app.jobs.records import JobSpec
from app.jobs.state import JobState


def spec(seed: int = 0, priority: int = 0) -> JobSpec:
    return JobSpec(kind="noise-study", settings={"seed": seed}, priority=priority)


def order(ledger: Ledger) -> list[int]:
    return [job.settings["seed"] for job in ledger.jobs(states=[JobState.queued])]


def test_a_submitted_job_is_there_for_another_process(tmp_path: Path):
    job = Ledger(tmp_path).submit(spec(seed=7))
    again = Ledger(tmp_path).get(job.id)
    assert again == job
    assert again.state is JobState.queued
    assert (tmp_path / job.id / "job.json").is_file()


def test_the_same_key_gives_the_first_job_again(tmp_path: Path):
    ledger = Ledger(tmp_path)
    first = ledger.submit(spec(1), key="click-1")
    assert ledger.submit(spec(2), key="click-1").id == first.id
    assert len(ledger.jobs()) == 1


def test_threads_that_submit_at_once_lose_and_double_nothing(tmp_path: Path):
    ledger = Ledger(tmp_path)
    threads = [
        threading.Thread(target=lambda n=n: ledger.submit(spec(n), key=str(n))) for n in [*range(16)] * 2
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(order(ledger)) == list(range(16))


def test_the_order_is_priority_then_place_and_both_can_be_changed(tmp_path: Path):
    ledger = Ledger(tmp_path)
    a, b, c = (ledger.submit(spec(n)) for n in range(3))
    assert order(ledger) == [0, 1, 2]
    ledger.set_priority(c.id, 5)
    assert order(ledger) == [2, 0, 1]
    ledger.move_before(b.id, a.id)
    assert order(ledger) == [2, 1, 0]
    ledger.move_before(a.id)
    assert order(ledger) == [0, 2, 1]


def test_a_waiting_job_pauses_resumes_cancels_and_is_retried_at_once(tmp_path: Path):
    ledger = Ledger(tmp_path)
    job = ledger.submit(spec()).id
    assert ledger.pause(job).state is JobState.paused
    assert ledger.resume(job).state is JobState.queued
    assert ledger.cancel(job).state is JobState.cancelled
    assert ledger.cancel(job).state is JobState.cancelled
    assert ledger.retry(job).state is JobState.queued
    with pytest.raises(JobError, match="is queued: there is nothing to resume"):
        ledger.resume(job)


def test_events_replay_from_any_id_and_never_change(tmp_path: Path):
    ledger = Ledger(tmp_path)
    job = ledger.submit(spec()).id
    ledger.pause(job)
    seen = ledger.events()
    assert [event.body["state"] for event in seen] == ["queued", "paused"]
    ledger.append_event("device", {"word": "camera 0 connected"})
    later = ledger.events(after=seen[-1].id)
    assert [event.kind for event in later] == ["device"]
    assert later[0].id == ledger.last_event() > seen[-1].id


@pytest.mark.parametrize(
    ("kind", "settings"),
    [("no-such", {}), ("../../etc", {}), ("noise-study", {"trails": 3}), ("noise-study", {"trials": -1})],
)
def test_what_cannot_be_computed_is_refused_before_it_is_queued(tmp_path: Path, kind: str, settings: dict):
    ledger = Ledger(tmp_path)
    with pytest.raises(BadInputError):
        ledger.submit(JobSpec(kind=kind, settings=settings))
    assert ledger.jobs() == []


def test_an_unknown_job_is_named_in_the_error(tmp_path: Path):
    with pytest.raises(UnknownJobError, match="'nobody'"):
        Ledger(tmp_path).cancel("nobody")


def test_many_jobs_are_queued_all_or_none(tmp_path: Path):
    ledger = Ledger(tmp_path)
    with pytest.raises(JobError):
        ledger.submit_many([spec(1), spec(2)], keys=["same", "same"])
    assert ledger.jobs() == []


def test_a_job_that_is_done_is_whole_wherever_its_steps_ended(tmp_path: Path):
    ledger = Ledger(tmp_path)
    job = replace(ledger.submit(spec()), step=99, steps=100)

    assert replace(job, state=JobState.failed).progress == pytest.approx(0.99)
    assert replace(job, state=JobState.done).progress == 1.0
