"""A real SLURM: `tests/cluster/slurm.sh start FOLDER`, then AIRLENS_SLURM=FOLDER."""

import os
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from app.jobs import EngineError, JobsConfig
from app.jobs.config import SlurmConfig
from app.jobs.engines.engine import Launch
from app.jobs.engines.slurm import SlurmEngine
from tests.cluster.story import check_cancel, check_lost_node, check_same_bits

SCRIPT = Path(__file__).with_name("slurm.sh")
SLURM = os.environ.get("AIRLENS_SLURM", "")
NEEDED = "needs SLURM: run tests/cluster/slurm.sh start FOLDER and set AIRLENS_SLURM=FOLDER"
pytestmark = [pytest.mark.cluster, pytest.mark.skipif(not SLURM, reason=NEEDED)]


@pytest.fixture
def config(monkeypatch: pytest.MonkeyPatch) -> JobsConfig:
    monkeypatch.setenv("SLURM_CONF", f"{SLURM}/slurm.conf")
    return JobsConfig(
        engine="slurm", lease_s=10.0, retry_first_s=0.5, slurm=SlurmConfig(python=sys.executable)
    )


def test_the_same_job_gives_the_same_bits_and_is_cancelled_with_a_checkpoint(
    tmp_path: Path, config: JobsConfig
):
    check_same_bits(tmp_path, config)
    check_cancel(tmp_path, config)


def test_a_partition_that_is_not_there_is_told_in_slurms_words(tmp_path: Path, config: JobsConfig):
    engine = SlurmEngine(SlurmConfig(partition="nowhere"))
    engine.probe()
    launch = Launch(job="j", attempt=1, folder=tmp_path, device="slot:0", memory_bytes=1 << 20, lease_s=10.0)
    with pytest.raises(EngineError, match="invalid partition"):
        engine.start(launch)
    assert engine.find(launch) is None


def test_a_node_killed_in_the_middle_costs_less_than_45_s(tmp_path: Path, config: JobsConfig):
    def kill_node(worker: psutil.Process) -> None:
        # What a power cut leaves of a node: neither the step with the worker nor the daemon.
        step = worker.parent()
        daemon = subprocess.run(
            ["squeue", "--noheader", "--format=%N"], capture_output=True, text=True, check=True
        )
        worker.kill()
        worker.wait(10)
        if step is not None:
            step.kill()
        subprocess.run([SCRIPT, "kill", SLURM, daemon.stdout.split()[0]], check=True)

    check_lost_node(tmp_path, config, kill_node)
