"""Promises: what figures and finished runs make of them, cold and warm, and how a run under way corrects its own."""

import pytest

from app.experiment.plan import Plan, PresetLine, SeenLine
from app.plan import promise as module
from app.plan.promise import Figures, Line, Task, figure_s, in_words, promise, renewed, source
from app.plan.runs import Run, keep_run
from core.plan.speed import Speed
from tests.benchmarks.promised import figures_of, stage_rows

FIGURES = Figures(
    measured="2026-01-02",
    start_s=2.0,
    read=Line(fixed_s=1.0, s_per_pixel=1e-6),
    measure=Line(fixed_s=2.0, s_per_pixel=2e-6),
    cold_s={"draft": 10.0, "grid": 40.0, "standard": 60.0},
    warm_s={"draft": 2.0, "grid": 5.0, "standard": 9.0},
    report_s={"draft": 3.0, "grid": 4.0, "standard": 7.0},
)
SPEEDS = {
    "draft": Speed(fixed_s=0.5, s_per_work=1e-3, fixed_mb=0.0, mb_per_size=0.0),
    "standard": Speed(fixed_s=5.0, s_per_work=1e-2, fixed_mb=0.0, mb_per_size=0.0),
}
DRAFT = Task("draft", programs="p", scene="s", pixels=1e6, work=500.0)
# The figures' own promise of it, cold: 2 + (1 + 1) + (2 + 2) + 10 + (0.5 + 0.5) + 3.
COLD_S = 22.0


@pytest.fixture(autouse=True)
def figures(monkeypatch, tmp_path):
    """Round figures, a ledger of this test, and a folder that holds a compiled program."""
    monkeypatch.setattr(module, "stage_figures", lambda: FIGURES)
    monkeypatch.setenv("AIRLENS_MACHINE", str(tmp_path / "machine.json"))
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "compiled"))
    (tmp_path / "compiled").mkdir()
    (tmp_path / "compiled" / "a-program").touch()
    return tmp_path / "compiled"


def ran(folder, task: Task = DRAFT, *, warm: bool = False, **seconds: float) -> Run:
    return Run(
        at="2026-01-02T03:04:05+00:00", preset=task.preset, programs=task.programs, scene=task.scene,
        folder=str(folder), warm=warm, pixels=task.pixels, work=task.work, seconds=seconds,
    )  # fmt: skip


def test_without_runs_the_figures_promise_with_compiling():
    found = promise(DRAFT, (), SPEEDS)
    assert not found.warm
    assert found.runs == 0
    assert found.wall_s == pytest.approx(COLD_S)
    assert found.solver_s == pytest.approx(11.0)


def test_each_stage_is_scaled_by_what_it_took(figures):
    # Reading took 3 times its 2 s, solving twice its 1 s; nothing was noted of the others.
    found = promise(DRAFT, (ran(figures, read=6.0, solve=2.0, compile=15.0),), SPEEDS)
    assert found.stages["read"] == pytest.approx(6.0)
    assert found.stages["solve"] == pytest.approx(2.0)
    assert found.stages["measure"] == pytest.approx(4.0)


def test_the_scale_holds_for_more_work(figures):
    twice = Task("draft", programs="q", scene="other", pixels=3e6, work=1500.0)
    found = promise(twice, (ran(figures, read=6.0, solve=2.0),), SPEEDS)
    # Figures of the larger run: reading 1 + 3 = 4 s, solving 0.5 + 1.5 = 2 s.
    assert found.stages["read"] == pytest.approx(12.0)
    assert found.stages["solve"] == pytest.approx(4.0)


def test_one_run_beside_another_program_does_not_lead_the_promise(figures):
    runs = tuple(ran(figures, solve=seconds) for seconds in (1.1, 30.0, 0.9))
    assert promise(DRAFT, runs, SPEEDS).stages["solve"] == pytest.approx(1.1)


def test_a_machine_that_has_become_slower_is_known_after_some_runs(figures):
    runs = tuple(ran(figures, solve=seconds) for seconds in [1.0] * 50 + [3.0] * 5)
    assert promise(DRAFT, runs, SPEEDS).stages["solve"] == pytest.approx(3.0)


def test_runs_of_the_same_scene_count_before_others(figures):
    other = Task("draft", programs="p", scene="other", pixels=1e6, work=500.0)
    runs = (ran(figures, solve=2.0), *(ran(figures, other, solve=9.0) for _ in range(9)))
    assert promise(DRAFT, runs, SPEEDS).stages["solve"] == pytest.approx(2.0)


def test_another_presets_runs_tell_how_fast_the_machine_is(figures):
    standard = Task("standard", programs="r", scene="s", pixels=1e6, work=1e4)
    found = promise(standard, (ran(figures, solve=2.0, start=4.0),), SPEEDS)
    assert found.stages["solve"] == pytest.approx(2 * 105.0)
    assert found.stages["start"] == pytest.approx(4.0)
    assert found.runs == 0


def test_a_preset_of_another_version_tells_nothing_and_does_no_harm(figures):
    gone = Task("gone", programs="g", scene="s", pixels=1e6, work=1.0)
    assert promise(DRAFT, (ran(figures, gone, solve=9.0, compile=9.0, report=9.0),), SPEEDS).wall_s == COLD_S
    assert promise(gone, (), SPEEDS).wall_s is None


def test_work_that_nobody_counted_is_promised_only_where_it_was_done_before(figures):
    unknown = Task("standard", programs="r", scene="s", pixels=1e6, work=None)
    assert promise(unknown, (), SPEEDS).wall_s is None
    assert promise(unknown, (ran(figures, unknown, solve=80.0),), SPEEDS).stages["solve"] == 80.0
    beside = tuple(ran(figures, unknown, solve=seconds) for seconds in (80.0, 900.0, 70.0))
    assert promise(unknown, beside, SPEEDS).stages["solve"] == 80.0
    elsewhere = Task("standard", programs="r", scene="other", pixels=1e6, work=None)
    assert promise(elsewhere, (ran(figures, unknown, solve=80.0),), SPEEDS).wall_s is None


def test_compiling_is_cold_until_the_same_programs_were_needed(figures):
    other = Task("draft", programs="q", scene="s", pixels=1e6, work=500.0)
    assert not promise(DRAFT, (ran(figures, other, compile=10.0),), SPEEDS).warm
    found = promise(DRAFT, (ran(figures, compile=20.0),), SPEEDS)
    assert found.warm
    # What compiling took cold says nothing of finding programs.
    assert found.stages["compile"] == pytest.approx(2.0)
    found = promise(DRAFT, (ran(figures, compile=20.0), ran(figures, warm=True, compile=3.0)), SPEEDS)
    assert found.stages["compile"] == pytest.approx(3.0)


def test_programs_that_are_gone_or_elsewhere_are_compiled_again(figures, monkeypatch, tmp_path):
    runs = (ran(figures, compile=20.0),)
    (figures / "a-program").unlink()
    assert promise(DRAFT, runs, SPEEDS).stages["compile"] == pytest.approx(20.0)
    (figures / "a-program").touch()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "a-program").touch()
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(elsewhere))
    assert not promise(DRAFT, runs, SPEEDS).warm
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "nowhere"))
    assert not promise(DRAFT, runs, SPEEDS).warm


def test_the_packaged_figures_are_the_committed_rows():
    packaged = Figures.model_validate_json(module.FIGURES.read_text(encoding="utf-8"))
    assert packaged == figures_of(stage_rows())


def test_every_preset_has_figures():
    for preset in ("draft", "grid", "standard", "reference", "paper"):
        task = Task(preset, programs="", scene="", pixels=1e6, work=1.0)
        for warm in (False, True):
            assert figure_s("compile", task, warm, SPEEDS)
            assert figure_s("report", task, warm, SPEEDS)


def test_a_kept_plan_is_shown_with_the_times_of_now(figures):
    line = PresetLine(
        preset="draft", fits=True, wall_s=1.0, solver_s=1.0, work=DRAFT.work, programs=DRAFT.programs,
        memory_mb=None, temperature_error_k=None, velocity_error=None, pressure_error=None, reason="",
    )  # fmt: skip
    old = line.model_copy(update={"programs": "", "work": None})
    plan = Plan(
        scene=DRAFT.scene, pixels=DRAFT.pixels, expected="", expected_contrast_k=1.0, expected_departure_k=1.0,
        views=[], seen=SeenLine(modes=1, modes_seen=1, images=0.0, boundary=0.0, both=0.0), choices=[],
        presets=[line, old], machine="before", verdicts=[],
    )  # fmt: skip
    keep_run(ran(figures, start=5.0))
    found = renewed(plan)
    assert found.presets[0].compiled
    told = promise(DRAFT)
    assert found.presets[0].wall_s == told.wall_s
    assert told.stages["start"] == pytest.approx(5.0)
    assert found.machine == source() == "as 1 run on this machine took"
    # A plan of an earlier version says what it said.
    assert found.presets[1] == old


def test_times_are_said_as_people_say_them():
    assert [in_words(s) for s in (0.2, 40.4, 150.0, 9000.0, 9.9e5)] == [
        "1 s",
        "40 s",
        "2 min",
        "2 h",
        "11 days",
    ]
