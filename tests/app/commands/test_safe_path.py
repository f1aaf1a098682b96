"""No process that the program starts imports from the folder that the operator stands in."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import app.cli
from app.bench.parts.isolated import alone
from app.client import Client

# Names of ours, of a library, and of Python's own that a starting process needs.
NAMES = ("app", "core", "drivers", "calibration", "jax", "numpy", "json", "random", "pickle")
TRAP = "import pathlib\npathlib.Path(__file__).with_suffix('.ran').touch()\nraise ImportError('a stranger')\n"


@pytest.fixture
def trap(tmp_path):
    """A folder of modules that leave a mark when they are imported."""
    folder = tmp_path / "trap"
    folder.mkdir()
    for name in NAMES:
        (folder / f"{name}.py").write_text(TRAP)
    yield folder
    assert sorted(folder.glob("*.ran")) == []


def airlens(*arguments):
    return [str(Path(sys.executable).with_name("airlens")), *arguments]


def test_the_trap_works(trap):
    ran = subprocess.run([sys.executable, "-c", "import app"], cwd=trap, capture_output=True, text=True)
    assert "a stranger" in ran.stderr
    (trap / "app.ran").unlink()


def test_service_supervisor_worker_and_the_reader_of_uploads(trap, tmp_path):
    picture = tmp_path / "numbers.npy"
    np.save(picture, np.zeros((4, 4), np.float32))
    command = airlens("serve", str(tmp_path / "data"), "--port", "0", "--json")
    with subprocess.Popen(command, cwd=trap, stdout=subprocess.PIPE, text=True) as service:
        try:
            assert service.stdout is not None
            with Client(json.loads(service.stdout.readline())["address"]) as client:
                assert client.upload(picture).arrays[0].shape == [4, 4]
                job = client.submit_job("noise-study", {"trials": 2, "size_px": 32})
                done = client.wait(job.job, limit_s=250)
                assert (done.state, done.reason) == ("done", "")
        finally:
            service.send_signal(signal.SIGINT)
            service.wait(timeout=100)


def test_a_process_of_a_benchmark(trap, monkeypatch):
    code = (
        "import os; from app.cli import main; from app.bench.parts.isolated import alone\n"
        "import sys; sys.argv = ['airlens', '--version']\n"
        "try: main()\nexcept SystemExit: pass\n"
        "if __name__ == '__main__': print(alone(os.getcwd)[0])"
    )
    script = trap.parent / "bench.py"
    script.write_text(code)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    ran = subprocess.run(
        [sys.executable, str(script)], cwd=trap, env=environment, capture_output=True, text=True, check=True
    )
    assert ran.stdout.split()[-1] == str(trap)
    assert alone.__module__ == "app.bench.parts.isolated"


def test_another_package_in_the_way_is_named(tmp_path, monkeypatch):
    (tmp_path / "drivers.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "drivers")
    said = app.cli.stranger()
    assert "'drivers' was found at" in said
    assert str(tmp_path / "drivers.py") in said
