"""The engine that a configuration names."""

from pathlib import Path

from app.jobs.config import JobsConfig
from app.jobs.engine import Engine
from app.jobs.local import LocalEngine


def create_engine(config: JobsConfig, folder: Path) -> Engine:
    """Return the configured engine. Raises EngineError when it cannot be used."""
    return LocalEngine(folder / "cache")
