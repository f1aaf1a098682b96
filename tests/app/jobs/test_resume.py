"""Killed in the middle and started again: the end is bitwise the same. Real processes, the preset `grid`."""

import signal
import subprocess
import sys
import time
from pathlib import Path

from app.experiment.results import read_result
from app.jobs import JobSpec, Ledger
from app.jobs.folder import JobFolder, Owner
from app.jobs.worker_status import DONE
from core.checkpoint import decode

ROOT = Path(__file__).parents[3]


class Attempts:
    """One job, run by a new process each time."""

    def __init__(self, folder: Path, experiment: Path) -> None:
        ledger = Ledger(folder)
        job = ledger.submit(JobSpec(kind="reconstruct", experiment=experiment, settings={"preset": "grid"}))
        self.folder, self.number = JobFolder(ledger.folder_of(job.id)), 0

    def begin(self) -> subprocess.Popen:
        self.number += 1
        self.folder.hand_over(Owner(self.number, f"attempt {self.number}"))
        command = [sys.executable, "-m", "app.worker", str(self.folder.path)]
        return subprocess.Popen(command, cwd=ROOT)

    def kept(self) -> list[Path]:
        return sorted(self.folder.attempt(self.number).glob("checkpoint/[0-9]*.checkpoint"))

    def wait_for_a_checkpoint(self, process: subprocess.Popen) -> None:
        deadline = time.monotonic() + 200
        while not self.kept() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.001)

    def result(self) -> bytes:
        found = read_result(self.folder.target() / "result.nc")
        assert found.velocity_m_s is not None
        return found.temperature_k.tobytes() + found.velocity_m_s.tobytes()


def test_kill_9_in_the_middle_and_again_ends_bitwise_the_same(experiment: Path, tmp_path: Path):
    job = Attempts(tmp_path / "killed", experiment)
    with job.begin() as process:
        job.wait_for_a_checkpoint(process)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert not job.folder.is_published()
    taken = decode(job.kept()[-1].read_bytes()).header["step"]
    assert taken >= 1

    with job.begin() as process:
        process.wait(200)
    assert process.returncode == DONE

    whole = Attempts(tmp_path / "whole", experiment)
    with whole.begin() as process:
        process.wait(200)
    assert process.returncode == DONE
    assert job.result() == whole.result()
