"""Two at once: nothing that was kept is lost, and a lock never outlives its holder."""

import json
import os
import signal
import subprocess
import sys
import threading

import pytest

from app.errors import AirlensError
from app.files.durable import durable_path, sweep, temporary_name, write_json
from app.files.lock import alone, locked

_COUNTER = """
import json, sys
from pathlib import Path
from app.files.durable import write_json
from app.files.lock import locked
path = Path(sys.argv[1])
for _ in range(int(sys.argv[2])):
    with locked(path.parent):
        content = json.loads(path.read_text())
        content[sys.argv[3]] = content.get(sys.argv[3], 0) + 1
        write_json(path, content)
"""


def test_what_processes_and_threads_count_together_is_all_there(tmp_path):
    path = tmp_path / "counts.json"
    write_json(path, {})
    arguments = [sys.executable, "-c", _COUNTER, str(path), "20"]
    others = [subprocess.Popen([*arguments, name]) for name in ("first", "second")]

    def count():
        for _ in range(20):
            with locked(tmp_path):
                content = json.loads(path.read_text())
                write_json(path, content | {"third": content.get("third", 0) + 1})

    threads = [threading.Thread(target=count) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [other.wait() for other in others] == [0, 0]
    assert json.loads(path.read_text()) == {"first": 20, "second": 20, "third": 40}


def test_writers_without_a_lock_never_write_into_one_another(tmp_path):
    path = tmp_path / "state.json"

    def write(number):
        for _ in range(30):
            write_json(path, {"number": number, "filler": str(number) * 20_000, "same": number})

    threads = [threading.Thread(target=write, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        if path.exists():
            content = json.loads(path.read_text())
            assert content["number"] == content["same"]
    assert [p.name for p in tmp_path.iterdir()] == ["state.json"]


def test_a_lock_that_is_kept_is_told_and_given_up(tmp_path):
    with (
        locked(tmp_path),
        pytest.raises(AirlensError, match="Another program"),
        locked(tmp_path, wait_s=0.05),
    ):
        pass
    with locked(tmp_path, wait_s=0.0):
        pass


def test_a_second_service_is_told_which_one_is_there_and_a_dead_one_lets_go(tmp_path):
    path = tmp_path / "service" / "lock"
    code = (
        "import sys, time; from pathlib import Path; from app.files.lock import alone\n"
        "with alone(Path(sys.argv[1]), 'service'): print('held', flush=True); time.sleep(1000)"
    )
    arguments = [sys.executable, "-c", code, str(path)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(AirlensError, match=f"process {holder.pid}, since 20"), alone(path, "service"):
            pass
        os.kill(holder.pid, signal.SIGKILL)
        holder.wait()
    with alone(path, "service"):
        pass


def test_what_a_dead_writer_left_is_removed_and_a_live_ones_file_stays(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    own = temporary_name(tmp_path / "result.nc")
    left = own.with_name(own.name.replace(f".{os.getpid()}-", f".{dead.pid}-"))
    young = left.with_name(left.name.replace("result", "young"))
    folder = left.with_name(left.name.replace("result", "folder"))
    (folder / "inner").mkdir(parents=True)
    for path in (own, left, young, tmp_path / "result.nc", tmp_path / ".tmp.nc"):
        path.write_text("half")
    for path in (own, left, folder):
        os.utime(path, (0, 0))
    assert set(sweep(tmp_path)) == {left, folder}
    assert {p.name for p in tmp_path.iterdir()} == {own.name, young.name, "result.nc", ".tmp.nc"}


def test_a_name_is_given_once(tmp_path):
    with durable_path(tmp_path / "a.json") as first, durable_path(tmp_path / "a.json") as second:
        assert first != second
        first.write_text("1")
        second.write_text("2")
    assert (tmp_path / "a.json").read_text() == "1"
