"""One job's trouble stays with that job: the round goes on, the reason is told, and there is a way out."""

import json
import sqlite3
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.errors import BadInputError
from app.jobs import JobsConfig, JobSpec, JobState, Ledger, Supervisor, explained, submit_ensemble
from app.jobs.engines.engine import Launch, ProcessState
from app.jobs.errors import JobError
from app.jobs.folder import JobFolder, try_lock
from app.jobs.state import JOB, JobEvent
from app.jobs.told import MOST, told
from app.jobs.watch import pause_after
from app.jobs.worker_status import FAILED

QUICK = JobsConfig(memory_reserve_bytes=0, disk_reserve_bytes=0, devices=("cpu:0", "cpu:1"))
DAYS_S = 172_800.0


class Standing:
    """An engine whose workers stand still: the test writes what a worker would, and ends it."""

    name = "standing"

    def __init__(self) -> None:
        self.alive: set[str] = set()
        self.ended: list[str] = []

    def probe(self) -> None: ...

    def start(self, launch: Launch) -> str:
        self.alive.add(launch.name)
        return launch.name

    def find(self, launch: Launch) -> str | None:
        return launch.name if launch.name in self.alive else None

    def state(self, handle: str) -> ProcessState:
        return ProcessState.running if handle in self.alive else ProcessState.gone

    def exit_status(self, handle: str) -> int | None:
        return None

    def stop(self, handle: str, *, kill: bool = False) -> None:
        self.ended.append(handle)
        self.alive.discard(handle)

    def close(self) -> None: ...


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    with Ledger(tmp_path / "jobs") as ledger:
        yield ledger


def study(ledger: Ledger, **settings: object) -> str:
    return ledger.submit(JobSpec(kind="noise-study", settings=settings, memory_bytes=0, disk_bytes=0)).id


def running_pair(ledger: Ledger) -> tuple[Supervisor, Standing, str, str]:
    """Two jobs that run; what follows breaks the first one."""
    engine = Standing()
    supervisor, broken, sound = Supervisor(ledger, QUICK, engine), study(ledger), study(ledger)
    assert supervisor.round() == ""
    assert {ledger.get(job).state for job in (broken, sound)} == {JobState.running}
    return supervisor, engine, broken, sound


def attempt_of(ledger: Ledger, job: str) -> Path:
    return JobFolder(ledger.folder / job).attempt(ledger.get(job).attempt)


def tell(ledger: Ledger, job: str, line: str) -> None:
    with open(attempt_of(ledger, job) / "events.jsonl", "a") as file:
        file.write(line + "\n")


def progress(**body: object) -> str:
    return json.dumps({"at_s": 1.0, "kind": "progress", "body": body})


def test_a_progress_line_may_hold_any_number(ledger: Ledger):
    supervisor, _, extreme, sound = running_pair(ledger)
    tell(ledger, extreme, progress(step=10**30, steps=10**300))
    tell(ledger, sound, progress(step=3, steps=10))
    assert supervisor.round() == ""
    assert (ledger.get(extreme).step, ledger.get(extreme).steps) == (MOST, MOST)
    assert (ledger.get(sound).step, ledger.get(sound).steps) == (3, 10)


@pytest.mark.parametrize(
    "line",
    [
        "no JSON",
        '{"at_s": NaN, "kind": "log", "body": {}}',
        '{"at_s": 1, "kind": "log", "body": {"x": NaN}}',
        '{"at_s": 1, "kind": "\\ud800", "body": {}}',
        '{"at_s": 1, "kind": "progress", "body": {"step": 1e999}}',
        '{"at_s": 1e999, "kind": "progress", "body": {}}',
        '{"at_s": 1, "kind": "progress", "body": {"step": ' + "9" * 5000 + "}}",
        '{"at_s": 1, "kind": "log", "body": ' + "[" * 5000 + "]" * 5000 + "}",
        "x" * (1 << 21),
    ],
)
def test_a_line_that_cannot_be_read_is_shown_with_its_reason_and_stops_nothing(ledger: Ledger, line: str):
    supervisor, _, broken, _ = running_pair(ledger)
    tell(ledger, broken, line)
    tell(ledger, broken, progress(step=5, steps=9))
    assert supervisor.round() == ""
    unreadable = [event for event in ledger.events(job=broken) if event.kind == "unreadable"]
    assert unreadable
    assert "cannot be read" in unreadable[0].body["reason"]
    assert (ledger.get(broken).state, ledger.get(broken).step) == (JobState.running, 5)


def test_told_keeps_what_can_be_read():
    line = told(progress(step=True, steps=2.5, value=1.5).encode())
    assert (line.kind, line.step, line.steps, line.body["value"]) == ("progress", 1, 2, 1.5)


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"kind": 7}', '{"kind": "gone", "settings": {}}', "\x00"]
)
def test_a_broken_order_fails_its_job_ends_its_worker_and_the_others_go_on(ledger: Ledger, content: str):
    supervisor, engine, broken, sound = running_pair(ledger)
    (ledger.folder / broken / "job.json").write_text(content)
    tell(ledger, sound, progress(step=3, steps=10))
    supervisor.round()
    assert ledger.get(broken).state is JobState.failed
    assert "job.json" in ledger.get(broken).reason or "gone" in ledger.get(broken).reason
    assert engine.ended == [f"airlens-{broken}-1"]
    assert (ledger.get(sound).state, ledger.get(sound).step) == (JobState.running, 3)


def test_a_broken_job_that_is_to_be_cancelled_is_cancelled(ledger: Ledger):
    supervisor, engine, broken, _ = running_pair(ledger)
    (ledger.folder / broken / "job.json").write_text("[]")
    assert ledger.cancel(broken).state is JobState.cancelling
    supervisor.round()
    assert ledger.get(broken).state is JobState.cancelled
    assert engine.ended == [f"airlens-{broken}-1"]
    assert ledger.retry(broken).state is JobState.queued


def test_a_broken_order_in_the_queue_fails_and_the_next_one_starts(ledger: Ledger):
    broken, sound = study(ledger), study(ledger)
    (ledger.folder / broken / "job.json").write_text("[]")
    Supervisor(ledger, JobsConfig(memory_reserve_bytes=0, disk_reserve_bytes=0), Standing()).round()
    assert (ledger.get(broken).state, ledger.get(sound).state) == (JobState.failed, JobState.running)


def test_an_error_of_the_system_is_waited_for_and_then_ends_the_job(
    ledger: Ledger, monkeypatch: pytest.MonkeyPatch
):
    supervisor, engine, broken, sound = running_pair(ledger)
    events = attempt_of(ledger, broken) / "events.jsonl"
    events.mkdir()  # neither a file nor absent
    assert "Is a directory" in supervisor.round()
    assert ledger.get(broken).state is JobState.running
    assert "Is a directory" in ledger.get(broken).reason
    now_s = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now_s + QUICK.start_limit_s + 1)
    # Its counter stands still for as long: the sound one must raise it.
    (attempt_of(ledger, sound) / "heartbeat").write_text("7")
    supervisor.round()
    assert ledger.get(broken).state is JobState.failed
    assert engine.ended == [f"airlens-{broken}-1"]
    assert ledger.get(sound).state is JobState.running


def test_an_exit_that_cannot_be_read_is_no_word(ledger: Ledger):
    supervisor, engine, broken, sound = running_pair(ledger)
    (attempt_of(ledger, broken) / "exit.json").write_text("{")
    (attempt_of(ledger, broken) / "log.txt").write_text("no module named jax\n")
    (attempt_of(ledger, sound) / "exit.json").write_text(json.dumps({"status": FAILED, "message": "Why."}))
    engine.alive.clear()
    supervisor.round()
    assert ledger.get(broken).state is JobState.lost
    assert "no module named jax" in ledger.get(broken).reason
    assert (ledger.get(sound).state, ledger.get(sound).reason) == (JobState.failed, "Why.")


def test_rows_that_cannot_be_read_are_shown_with_their_reason(ledger: Ledger):
    job, other = study(ledger), study(ledger)
    with sqlite3.connect(ledger.folder / "ledger.sqlite") as database:
        database.execute("UPDATE jobs SET settings = '[' WHERE id = ?", (job,))
        database.execute("UPDATE events SET body = '[' WHERE job_id = ?", (job,))
        database.execute("UPDATE jobs SET title = CAST(x'ff41' AS TEXT) WHERE id = ?", (other,))
    database.close()
    assert "cannot be read" in ledger.get(job).reason
    assert [event.body.get("state") for event in ledger.events()] == [None, "queued"]
    assert ledger.get(other).title == "�A"


@pytest.mark.parametrize(
    "settings",
    [{"trials": 10**30}, {"seed": 10**30}, {"frames": 10**40}, {"window_px": 10**30}, {"electrons": 10**200}],
)
def test_extreme_settings_are_refused(ledger: Ledger, settings: dict):
    with pytest.raises(BadInputError, match="less than or equal to"):
        study(ledger, **settings)
    assert ledger.jobs() == []


def test_extreme_numbers_beside_the_settings_are_refused(ledger: Ledger):
    for numbers in ({"priority": 10**30}, {"memory_bytes": 10**400}, {"disk_bytes": -(10**30)}):
        with pytest.raises(BadInputError, match="Give a smaller number"):
            ledger.submit(JobSpec(kind="noise-study", **numbers))
    with pytest.raises(BadInputError, match="are possible"):
        submit_ensemble(ledger, JobSpec(kind="noise-study"), 10**30)
    with pytest.raises(BadInputError):
        ledger.set_priority(study(ledger), 10**30)
    assert pause_after(100_000, QUICK) == QUICK.retry_longest_s


def test_nothing_is_left_of_a_submission_that_the_disk_refused(ledger: Ledger, monkeypatch):
    def full(row: dict) -> None:
        JobFolder(ledger.folder / row["id"]).path.mkdir()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(ledger, "_make_folder", full)
    with pytest.raises(OSError, match="No space"):
        study(ledger)
    assert list(ledger.folder.glob("j*")) == []


@pytest.mark.parametrize("jump_s", [-DAYS_S, DAYS_S])
def test_a_clock_that_jumps_keeps_no_lost_job_waiting_and_kills_no_living_one(
    ledger: Ledger, monkeypatch: pytest.MonkeyPatch, jump_s: float
):
    supervisor, engine, lost, living = running_pair(ledger)
    engine.alive.discard(f"airlens-{lost}-1")
    supervisor.round()
    assert ledger.get(lost).state is JobState.lost
    ledger.cancel(living)
    stop = engine.stop
    monkeypatch.setattr(engine, "stop", lambda handle, kill=False: stop(handle) if kill else None)
    supervisor.round()
    wall_s, since_s = time.time(), time.monotonic()
    monkeypatch.setattr(time, "time", lambda: wall_s + jump_s)
    monkeypatch.setattr(time, "monotonic", lambda: since_s + 2 * QUICK.retry_first_s)
    supervisor.round()
    assert ledger.get(lost).state is JobState.running
    # It has its time to write a checkpoint, whatever the clock says.
    assert engine.ended == []
    assert ledger.get(living).state is JobState.cancelling
    monkeypatch.setattr(time, "monotonic", lambda: since_s + QUICK.stop_limit_s + 1)
    supervisor.round()
    assert engine.ended == [f"airlens-{living}-1"]


def test_a_ledger_of_the_schema_before_is_taken_over(tmp_path: Path):
    with Ledger(tmp_path) as ledger:
        job = study(ledger)
    with sqlite3.connect(tmp_path / "ledger.sqlite") as database:
        database.execute("ALTER TABLE jobs ADD COLUMN retry_at_s REAL")
        database.execute("ALTER TABLE jobs ADD COLUMN stop_asked_s REAL")
        database.execute("PRAGMA user_version = 1")
    database.close()
    with Ledger(tmp_path) as ledger:
        assert ledger.get(job).state is JobState.queued
        assert ledger.cancel(job).state is JobState.cancelled


def why(ledger: Ledger, job: str) -> str:
    return explained(ledger, [ledger.get(job)])[0].reason


def test_a_job_that_waits_always_says_why(ledger: Ledger):
    job = study(ledger)
    (ledger.folder / "supervisor.log").write_text("airlens: jobs.toml: no such engine\n")
    assert "No supervisor runs" in why(ledger, job)
    assert "no such engine" in why(ledger, job)
    lock = try_lock(ledger.folder / "supervisor.lock")
    assert lock is not None
    with lock:
        assert "next look" in why(ledger, job)
        supervisor = Supervisor(ledger, JobsConfig(memory_reserve_bytes=0, disk_reserve_bytes=0), Standing())
        supervisor.round()
        next_one = study(ledger)
        supervisor.round()
        assert why(ledger, job) == ""
        assert f"Taken: cpu:0 by noise-study ({job})" in why(ledger, next_one)
        ledger.cancel(job)
        assert "checkpoint" in why(ledger, job)


@pytest.mark.parametrize("state", JobState)
def test_no_state_of_a_job_is_without_a_way_out(state: JobState):
    if state is not JobState.done:
        assert JobState.done in JOB.reachable(state)
    refused: list[JobEvent] = [event for event in JobEvent if not JOB.allows(state, event)]
    for event in refused:
        with pytest.raises(JobError, match=f"is {state}: there is nothing to {event}"):
            JOB.after(state, event)


def test_a_round_that_raises_is_not_the_last(ledger: Ledger, monkeypatch: pytest.MonkeyPatch):
    supervisor = Supervisor(ledger, JobsConfig(poll_s=0.01), Standing())
    rounds: list[int] = []

    class Enough:
        def is_set(self) -> bool:
            return len(rounds) >= 3

        def wait(self, pause_s: float) -> None: ...

    def defective() -> str:
        rounds.append(1)
        raise OverflowError("Python int too large to convert to SQLite INTEGER")

    monkeypatch.setattr(supervisor, "round", defective)
    run: Callable[..., None] = supervisor.run
    run(Enough())
    assert len(rounds) == 3
