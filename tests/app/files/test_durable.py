import json
import os
import signal
import subprocess
import sys
import time

import pytest

from app.files.durable import durable_path, write_json

_WRITER = """
import sys
from pathlib import Path
from app.files.durable import write_json
path = Path(sys.argv[1])
number = 0
while True:
    number += 1
    write_json(path, {"number": number, "filler": "x" * 200_000, "same": number})
"""


def test_a_killed_process_leaves_the_old_file_or_the_new_one(tmp_path):
    path = tmp_path / "state.json"
    for round_ in range(8):
        writer = subprocess.Popen([sys.executable, "-c", _WRITER, str(path)])
        deadline = time.monotonic() + 100
        before = path.stat().st_mtime_ns if path.exists() else 0
        while (not path.exists() or path.stat().st_mtime_ns == before) and time.monotonic() < deadline:
            time.sleep(0.005)
        time.sleep(0.002 * round_)
        os.kill(writer.pid, signal.SIGKILL)
        writer.wait()
        content = json.loads(path.read_text())
        assert content["number"] == content["same"]
        assert len(content["filler"]) == 200_000


def test_a_failed_write_keeps_the_old_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "result.json"
    write_json(path, {"good": 1})
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(path, {"bad": float("nan")})
    with pytest.raises(RuntimeError, match="half way"), durable_path(path) as temporary:  # noqa: PT012
        temporary.write_text("half")
        raise RuntimeError("half way")
    assert json.loads(path.read_text()) == {"good": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]


def test_a_full_disk_is_an_error_and_the_old_file_stays(tmp_path):
    path = tmp_path / "result.json"
    write_json(path, {"good": 1})
    # A process that may write 1 kB a file: what a full disk looks like to a writer.
    code = (
        "import resource, signal, sys; from pathlib import Path; from app.files.durable import write_json\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "write_json(Path(sys.argv[1]), {'filler': 'x' * 5000})"
    )
    ran = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False)
    assert ran.returncode != 0
    assert json.loads(path.read_text()) == {"good": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]
