"""The ledger of finished runs: broken lines, several writers, no folder to write to, and an end to its growth."""

import json
import multiprocessing
from pathlib import Path

from app.plan import runs as module
from app.plan.runs import Run, keep_run, kept_runs, runs_path


def run(number: int = 0) -> Run:
    return Run(
        at="2026-01-02T03:04:05+00:00", preset="draft", programs="p", scene=f"s{number}", folder="/x",
        warm=True, pixels=1.0, work=2.0, seconds={"solve": 1.5},
    )  # fmt: skip


def test_runs_lie_beside_the_machines_figures(tmp_path, monkeypatch):
    monkeypatch.setenv("AIRLENS_MACHINE", str(tmp_path / "new" / "machine.json"))
    assert kept_runs() == ()
    keep_run(run())
    assert runs_path().parent == tmp_path / "new"
    assert kept_runs() == (run(),)


def test_lines_that_are_no_runs_are_passed_over(tmp_path):
    path = tmp_path / "runs.jsonl"
    keep_run(run(1), path)
    other = json.dumps({**json.loads(run().model_dump_json()), "pixels": "many"})
    endless = run().model_dump_json().replace("1.5", "Infinity")
    assert "Infinity" in endless
    with path.open("ab") as file:
        file.write(b'\n[1, 2]\n{"at": 3}\n\xff\xfe\n' + other.encode() + b"\n" + endless.encode())
        file.write(b'\n{"at": "cut of')
    keep_run(run(2), path)
    assert kept_runs(path) == (run(1), run(2))


def test_runs_that_end_at_a_time_are_all_kept(tmp_path):
    path = tmp_path / "runs.jsonl"
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        pool.starmap(keep_run, [(run(n), path) for n in range(40)])
    assert sorted(found.scene for found in kept_runs(path)) == sorted(f"s{n}" for n in range(40))


def test_where_nothing_can_be_written_there_are_no_runs_and_no_error(tmp_path):
    file = tmp_path / "file"
    file.touch()
    keep_run(run(), file / "cache" / "runs.jsonl")
    assert kept_runs(file / "cache" / "runs.jsonl") == ()
    folder = tmp_path / "runs.jsonl"
    folder.mkdir()
    keep_run(run(), folder)
    assert kept_runs(folder) == ()


def test_an_error_of_the_disk_is_nobodys_concern(tmp_path, monkeypatch):
    def full(path: Path, line: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "_append", full)
    keep_run(run(), tmp_path / "runs.jsonl")
    assert kept_runs(tmp_path / "runs.jsonl") == ()


def test_the_oldest_are_let_go(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "KEPT", 3)
    path = tmp_path / "runs.jsonl"
    for number in range(20):
        keep_run(run(number), path)
        assert len(path.read_text().splitlines()) <= 6
    assert kept_runs(path)[-3:] == (run(17), run(18), run(19))
