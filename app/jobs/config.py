"""How jobs run: `jobs.toml` in the folder of jobs. Without the file: this machine, one job at a time."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from app.files.toml import Strict, read_toml

GIB = 1 << 30
MOST_BYTES = 1 << 60
LONGEST_S = 86_400.0


class RayConfig(Strict):
    """A Ray head's Jobs API. The token is read from a file, so that no process list shows it."""

    address: str = "http://127.0.0.1:8265"
    token_file: str = "~/.ray/auth_token"
    python: str = "python"
    gpus_per_job: float = Field(default=0.0, ge=0, le=1000)
    cpus_per_job: float = Field(default=1.0, ge=0, le=10_000)


class SlurmConfig(Strict):
    """Options of `sbatch`."""

    partition: str = ""
    gpus_per_job: int = Field(default=0, ge=0, le=1000)
    cpus_per_job: int = Field(default=1, ge=1, le=10_000)
    time_limit: str = ""
    python: str = "python"


class JobsConfig(Strict):
    """Everything the supervisor may be told. `engine` is the one line that switches."""

    engine: Literal["local", "ray", "slurm"] = "local"
    devices: tuple[str, ...] = Field(default=("cpu:0",), min_length=1, strict=False)
    lease_s: float = Field(default=15.0, ge=1, le=LONGEST_S)
    start_limit_s: float = Field(default=60.0, gt=0, le=LONGEST_S)
    stop_limit_s: float = Field(default=12.0, gt=0, le=LONGEST_S)
    max_losses: int = Field(default=5, ge=1, le=1_000_000)
    retry_first_s: float = Field(default=1.0, gt=0, le=LONGEST_S)
    retry_longest_s: float = Field(default=300.0, gt=0, le=LONGEST_S)
    memory_reserve_bytes: int = Field(default=GIB // 2, ge=0, le=MOST_BYTES)
    disk_reserve_bytes: int = Field(default=GIB // 8, ge=0, le=MOST_BYTES)
    poll_s: float = Field(default=0.2, gt=0, le=60)
    ray: RayConfig = RayConfig()
    slurm: SlurmConfig = SlurmConfig()


def read_config(folder: Path) -> JobsConfig:
    """Return the configuration of a folder of jobs. Raises BadInputError with the line that is wrong."""
    path = folder / "jobs.toml"
    return read_toml(path, JobsConfig) if path.exists() else JobsConfig()
