"""What is known of time and error: the committed sweep, the README's table, this machine's figures."""

from pathlib import Path

import pytest

from app.benches.calibrate import Cost, line_through
from app.errors import BadInputError
from app.machine import Machine, keep_machine, read_machine, this_machine
from app.presets import PRESETS
from app.tradeoff import expected_error, front, rows, table
from core.plan.cost import Speed, Work

README = Path(__file__).resolve().parents[2] / "README.md"


def test_the_readmes_table_is_the_committed_sweep():
    assert table(rows()) in README.read_text(encoding="utf-8")


def test_rows_name_presets_that_exist():
    assert {row["preset"] for row in rows() if row["preset"]} <= set(PRESETS)


def test_predictions_are_the_rows_medians():
    own = [
        r["T_share"]
        for r in rows()
        if (r["preset"], r["level"], r["light"]) == ("draft", "surveyed", "texture")
    ]
    known = expected_error("draft", "surveyed", "texture")
    assert known is not None
    assert min(own) <= known.temperature <= max(own)
    assert known.velocity is None
    assert expected_error("draft", "surveyed", "moonlight") is None


def test_the_front_is_what_nothing_quicker_beats():
    sweep = [
        {"solver_s": s, "u": u} for s, u in ((1.0, 0.9), (2.0, 0.95), (4.0, 0.3), (9.0, None), (8.0, 0.4))
    ]
    assert [row["solver_s"] for row in front(sweep, "u")] == [1.0, 4.0]


def test_two_trials_make_a_line_that_predicts_a_third():
    true = Speed(fixed_s=3.0, s_per_work=2e-6, fixed_mb=500.0, mb_per_size=0.01)
    small, large, third = (Work(loops, loops / 100) for loops in (1e5, 1e6, 4e6))
    found = line_through(*(Cost(w, true.seconds(w), true.megabytes(w)) for w in (small, large)))
    assert found.seconds(third) == pytest.approx(true.seconds(third))
    assert found.megabytes(third) == pytest.approx(true.megabytes(third))


def test_noise_never_predicts_that_more_work_is_quicker():
    found = line_through(Cost(Work(1.0, 1.0), 5.0, 800.0), Cost(Work(2.0, 2.0), 4.0, 700.0))
    assert found.s_per_work == 0.0
    assert found.mb_per_size == 0.0


def test_this_machines_figures_are_kept_and_preferred(tmp_path, monkeypatch):
    path = tmp_path / "machine.json"
    monkeypatch.setenv("AIRLENS_MACHINE", str(path))
    speed = Speed(fixed_s=1.0, s_per_work=2.0, fixed_mb=3.0, mb_per_size=4.0)
    kept = Machine(name="here", measured="2026-01-02", speeds={"draft": speed})
    assert "another machine" in this_machine()[1]
    keep_machine(kept, path)
    assert this_machine() == (kept, "measured on this machine, 2026-01-02")


def test_figures_that_are_none_are_refused(tmp_path):
    path = tmp_path / "machine.json"
    path.write_text("{", encoding="utf-8")
    with pytest.raises(BadInputError, match="bench calibrate"):
        read_machine(path)
