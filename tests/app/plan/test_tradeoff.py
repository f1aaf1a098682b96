"""What is known of time and error: the committed sweep, the README's table, this machine's figures."""

from pathlib import Path

import numpy as np
import pytest

from app.bench.calibrate import Cost, line_through
from app.bench.parts.ray_sweep import traced
from app.bench.tradeoff import POINTS, draw
from app.errors import BadInputError
from app.plan.machine import Machine, keep_machine, read_machine, this_machine
from app.plan.tradeoff import (
    ROWS,
    UNSEEN,
    expected_error,
    front,
    headline,
    judged,
    off_front,
    rows,
    span,
    table,
)
from app.reconstruct.presets import PRESETS
from app.simulate.rehearsal import SAMPLE_ROOM
from app.volume.file import read_volume
from app.volume.measurement import fine_field
from app.volume.scene import RigOptions, room_scene
from core.plan.speed import Speed, Work

ROOT = Path(__file__).resolve().parents[3]


def test_the_readmes_tables_are_the_committed_sweep():
    both = rows(ROWS, UNSEEN)
    assert headline(both) in (ROOT / "README.md").read_text(encoding="utf-8")
    assert table(both) in (ROOT / "app" / "plan" / "README.md").read_text(encoding="utf-8")


def test_rows_name_presets_that_exist():
    assert {row["preset"] for row in rows(ROWS, UNSEEN) if row["preset"]} <= set(PRESETS)


def test_predictions_are_medians_over_rooms_that_nothing_was_set_on():
    own = [
        r
        for r in rows(UNSEEN)
        if (r["preset"], r["level"], r["light"]) == ("standard", "surveyed", "texture")
    ]
    known = expected_error("standard", "surveyed", "texture")
    assert known is not None
    assert known.unseen
    assert known.rooms == len(own) >= 5
    shares = [r["T_air_contrast"] for r in own if r["T_air_contrast"] is not None]
    assert known.temperature == np.median(shares)
    assert known.velocity == np.median([r["u"] for r in own])
    assert (known.worst_temperature, known.worst_velocity) == (
        max(shares),
        max(r["u"] for r in own),
    )
    assert expected_error("draft", "surveyed", "moonlight") is None


def test_rooms_that_the_settings_were_chosen_on_count_where_there_are_no_others():
    known = expected_error("standard", "paper", "texture")
    assert known is not None
    assert not known.unseen
    chosen_on, unseen = {"room": "A", "misread": None}, {"room": "room1", "misread": 1}
    assert judged([chosen_on, unseen]) == [unseen]
    assert judged([chosen_on]) == [chosen_on]


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


def test_off_the_front_is_judged_among_alike():
    alike = {"room": "A", "information": "paper", "light": "texture"}
    sweep = [
        {**alike, "preset": None, "solver_s": 1.0, "u": 0.4},
        {**alike, "preset": "slow", "solver_s": 200.0, "u": 0.5},
        {**alike, "preset": "best", "solver_s": 300.0, "u": 0.1},
        {**alike, "room": "B", "preset": None, "solver_s": 1.0, "u": 0.01},
    ]
    assert off_front(sweep, "slow", "u") == pytest.approx(1.25)
    assert off_front(sweep, "best", "u") == 1.0
    assert off_front(sweep, "unknown", "u") is None
    assert span(sweep[:3], "u") == 300.0


def test_the_committed_front_is_wide_and_the_presets_lie_on_it():
    kept = rows()
    assert span(kept, "u") >= 50
    for preset, quantity in (
        ("draft", "T_share"), ("grid", "T_share"), ("grid", "u"), ("standard", "T_share"), ("standard", "u")
    ):  # fmt: skip
        distance = off_front(kept, preset, quantity)
        assert distance is not None
        assert distance <= 1.2


def test_the_plot_shows_every_row_of_a_whole_sweep(tmp_path):
    assert {row["method"] for row in rows()} == {point.method for point in POINTS}
    draw(rows(), tmp_path / "front.png")
    assert (tmp_path / "front.png").stat().st_size > 10_000


def test_more_steps_cost_more_operations_and_come_nearer():
    volume = read_volume(SAMPLE_ROOM)
    scene = room_scene(volume, RigOptions(camera_px=(256, 192)), "paper")
    pixels = np.stack(np.meshgrid(np.arange(48.0, 208.0, 16), np.arange(48.0, 144.0, 16)), -1).reshape(-1, 2)
    field = fine_field(volume, scene)
    few, many, most = (traced(scene, field, pixels, "straight", n, 1) for n in (16, 64, 256))
    assert few.operations < many.operations < most.operations
    assert many.off_px(most) < few.off_px(most)
