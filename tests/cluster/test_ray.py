"""A real Ray head with a token: `tests/cluster/ray.sh start FOLDER`, then AIRLENS_RAY=FOLDER."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from app.jobs import EngineError, JobsConfig
from app.jobs.config import RayConfig
from app.jobs.engines.ray import RayEngine
from tests.cluster.story import check_cancel, check_lost_node, check_same_bits

SCRIPT = Path(__file__).with_name("ray.sh")
RAY = os.environ.get("AIRLENS_RAY", "")
NEEDED = "needs a Ray head: run tests/cluster/ray.sh start FOLDER and set AIRLENS_RAY=FOLDER"
pytestmark = [pytest.mark.cluster, pytest.mark.skipif(not RAY, reason=NEEDED)]


def config(token_file: str = f"{RAY}/token", port: int = 28265) -> JobsConfig:
    ray = RayConfig(address=f"http://127.0.0.1:{port}", token_file=token_file, python=sys.executable)
    return JobsConfig(engine="ray", lease_s=10.0, retry_first_s=0.5, ray=ray)


def test_the_same_job_gives_the_same_bits_and_is_cancelled_with_a_checkpoint(tmp_path: Path):
    check_same_bits(tmp_path, config())
    check_cancel(tmp_path, config())


def test_the_wrong_token_is_told_apart_from_no_head(tmp_path: Path):
    wrong = tmp_path / "token"
    wrong.write_text("0" * 64)
    stranger, nobody = RayEngine(config(token_file=str(wrong)).ray), RayEngine(config(port=9).ray)
    with contextlib.closing(stranger), pytest.raises(EngineError, match="answered 40"):
        stranger.probe()
    with contextlib.closing(nobody), pytest.raises(EngineError, match="cannot be reached"):
        nobody.probe()


def test_a_node_killed_in_the_middle_costs_less_than_45_s(tmp_path: Path):
    sessions = {int((Path(RAY) / f"{name}.pid").read_text()): name for name in ("node1", "node2")}

    def kill_node(worker: psutil.Process) -> None:
        node = next(sessions[s] for s in map(os.getsid, [p.pid for p in worker.parents()]) if s in sessions)
        subprocess.run([SCRIPT, "kill", RAY, node], check=True)

    check_lost_node(tmp_path, config(), kill_node)
