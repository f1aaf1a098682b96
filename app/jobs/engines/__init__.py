"""The engine that a configuration names."""

from app.jobs.config import JobsConfig
from app.jobs.engines.engine import Engine
from app.jobs.engines.local import LocalEngine
from app.jobs.engines.ray import RayEngine
from app.jobs.engines.slurm import SlurmEngine


def create_engine(config: JobsConfig) -> Engine:
    """Return the configured engine."""
    engines = {
        "local": LocalEngine,
        "ray": lambda: RayEngine(config.ray),
        "slurm": lambda: SlurmEngine(config.slurm),
    }
    return engines[config.engine]()
