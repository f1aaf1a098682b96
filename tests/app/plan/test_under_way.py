"""A run under way: its stages, what is compiled in them, and the time left."""

import pytest

from app.plan import under_way as module
from app.plan.compiling import Compiling, union
from app.plan.promise import Promise, Task
from app.plan.runs import kept_runs
from app.plan.under_way import UnderWay, corrected_s
from core.watch import Watch

TASK = Task("draft", programs="p", scene="s", pixels=1e6, work=500.0)
STAGES = {"start": 4.0, "read": 2.0, "measure": 3.0, "compile": 10.0, "solve": 20.0, "report": 5.0}


class Machine:
    """A clock that is moved by hand, and a compiler that tells of itself as JAX does."""

    def __init__(self, monkeypatch) -> None:
        self.now_s = 100.0
        self.heard = Compiling()
        monkeypatch.setattr("app.plan.compiling.time.perf_counter", self)

    def __call__(self) -> float:
        return self.now_s

    def works(self, seconds: float) -> None:
        self.now_s += seconds

    def compiles(self, seconds: float, *, found: bool = False) -> None:
        self.now_s += seconds
        self.heard.on_duration("/jax/core/compile/backend_compile_duration", seconds, fun_name="f")
        if found:
            self.heard.on_event("/jax/compilation_cache/cache_hits")


@pytest.fixture
def machine(monkeypatch, tmp_path):
    monkeypatch.setenv("AIRLENS_MACHINE", str(tmp_path / "machine.json"))
    monkeypatch.setattr(module, "promise", lambda task: Promise(STAGES, warm=False, runs=3))
    return Machine(monkeypatch)


def begun(machine: Machine, start_s: float | None = None) -> UnderWay:
    run = UnderWay(start_s, machine.heard, machine)
    run.begin(TASK, afresh=True)
    return run


def test_moments_of_threads_and_nested_programs_count_once():
    assert union([(5.0, 6.0), (0.0, 2.0), (1.0, 3.0), (1.5, 1.6)]) == [(0.0, 3.0), (5.0, 6.0)]


def test_a_finished_run_is_kept_with_its_seconds_by_stage(machine):
    run = begun(machine, start_s=4.5)
    run.enter("read")
    machine.works(1.0)
    run.enter("measure")
    machine.compiles(2.0)
    machine.works(3.0)
    run.enter("solve")
    machine.compiles(6.0)
    machine.works(7.0)
    run.enter("report")
    machine.works(5.0)
    run.keep()
    (kept,) = kept_runs()
    assert kept.seconds == {
        "start": 4.5, "read": 1.0, "measure": 3.0, "compile": 8.0, "solve": 7.0, "report": 5.0,
    }  # fmt: skip
    assert kept.warm is False
    assert (kept.preset, kept.programs, kept.scene, kept.work) == ("draft", "p", "s", 500.0)


def test_a_run_whose_programs_were_found_is_warm_and_one_without_says_nothing_of_compiling(machine):
    run = begun(machine)
    machine.compiles(1.0, found=True)
    machine.compiles(1.0, found=True)
    machine.compiles(1.0)
    run.keep()
    again = begun(machine)
    machine.works(1.0)
    again.keep()
    warm, none = kept_runs()
    assert warm.warm is True
    assert warm.seconds["compile"] == pytest.approx(3.0)
    assert none.warm is None
    assert "compile" not in none.seconds


def test_a_run_that_goes_on_from_an_earlier_one_promises_nothing_and_is_not_kept(machine):
    run = UnderWay(None, machine.heard, machine)
    run.begin(TASK, afresh=False)
    assert run.said == ""
    assert run.left_s is None
    run.keep()
    assert kept_runs() == ()


def test_the_time_left_is_that_of_the_stages_to_come(machine):
    run = begun(machine, start_s=4.0)
    # All but the start, which is over.
    assert run.left_s == pytest.approx(40.0)
    assert run.said == "About 40 s (usual on this machine; with compiling)."
    assert run.promised_s == pytest.approx(44.0)
    run.enter("measure")
    machine.works(1.0)
    assert run.left_s == pytest.approx(2.0 + 10.0 + 20.0 + 5.0)
    # What is compiled is compiled, in whichever stage.
    machine.compiles(4.0)
    assert run.left_s == pytest.approx(2.0 + 6.0 + 20.0 + 5.0)
    run.enter("report")
    machine.works(9.0)
    assert run.left_s == 0.0


def test_rows_say_how_long_yet_by_the_pace_of_the_stage(machine):
    told = []
    run = begun(machine)
    watch = run.watched(Watch(lambda row, growing: told.append(row)))
    run.enter("solve")
    machine.compiles(10.0)
    # Half is done after 40 s of work, where 10 s were promised.
    machine.works(40.0)
    watch.tell({"doing": "march", "share": 0.5})
    assert told[0]["left_s"] == pytest.approx(corrected_s(20.0, 40.0, 0.5) + 5.0)
    assert told[0]["left_s"] > 20.0
    machine.works(40.0)
    watch.tell({"doing": "march", "share": 1.0})
    assert told[1]["left_s"] == pytest.approx(5.0)


def test_without_a_promise_rows_say_nothing_of_it(machine, monkeypatch):
    monkeypatch.setattr(module, "promise", lambda task: Promise({**STAGES, "solve": None}, warm=True, runs=0))
    run, told = begun(machine), []
    assert "airlens plan" in run.said
    run.watched(Watch(lambda row, growing: told.append(row))).tell({"doing": "read"})
    assert told == [{"doing": "read"}]


def test_a_stage_is_corrected_the_more_the_further_it_is():
    assert corrected_s(20.0, 0.0, 0.0) == 20.0
    assert corrected_s(20.0, 5.0, 0.0) == 15.0
    # A run that keeps its promise is told so all the way.
    assert [corrected_s(20.0, 20.0 * s, s) for s in (0.25, 0.5, 1.0)] == [15.0, 10.0, 0.0]
    # One that takes twice as long is believed to, in the end: 4 s yet of 40 at nine tenths.
    assert corrected_s(20.0, 36.0, 0.9) == pytest.approx(4.0, rel=0.06)
