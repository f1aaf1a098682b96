"""What a job can compute. A kind is a module here with

    EXPERIMENT: bool                         whether it needs an experiment folder
    read(settings) -> Settings               BadInputError for a setting that it refuses; cheap to import
    run(attempt, settings) -> dict              the computation; returns the summary in the result
    target(job, folder) -> Path              where the finished folder goes (optional; default: in the job)

Names of kinds come from the modules found here, never from user text: `-` in a name is `_` in a module.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from app.errors import BadInputError


def names() -> list[str]:
    """Return the names of all kinds."""
    return sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(__path__))


def load(kind: str) -> ModuleType:
    """Return the module of a kind. Raises BadInputError for a name that is none."""
    if kind not in names():
        raise BadInputError(f"There is no kind of job {kind!r}. The kinds are: {', '.join(names())}.")
    return importlib.import_module(f"{__name__}.{kind.replace('-', '_')}")


def check(kind: str, settings: Mapping[str, Any], experiment: Path | None) -> None:
    """Raise BadInputError unless a job of this kind can be run with these settings."""
    module = load(kind)
    module.read(settings)
    if module.EXPERIMENT and experiment is None:
        raise BadInputError(f"A job of kind {kind!r} works on an experiment: name its folder.")
    if experiment is not None and not (Path(experiment) / "experiment.toml").is_file():
        raise BadInputError(
            f"{experiment} holds no experiment.toml, so it is no experiment. Name a folder that does."
        )
