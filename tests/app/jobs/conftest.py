"""One small experiment for all jobs that reconstruct."""

from pathlib import Path

import pytest

from tests.rooms import small_experiment


@pytest.fixture(scope="session")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_experiment(tmp_path_factory.mktemp("rig") / "experiment", 8)
