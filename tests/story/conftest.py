"""One small experiment on the packaged room, made once for every story."""

from importlib.resources import files
from pathlib import Path

import pytest

from app.experiment.rig_settings import SimulatedCameraSettings
from app.pipeline import reconstruct
from app.simulate.experiment import simulate
from app.volume.scene import RigOptions

ROOM = Path(str(files("app.simulate.sample") / "room.npz"))


@pytest.fixture(scope="session")
def experiment(tmp_path_factory):
    folder = tmp_path_factory.mktemp("story") / "room"
    options = RigOptions(camera_px=(512, 384), frames=1)
    return simulate(
        ROOM, folder, options, "surveyed", SimulatedCameraSettings(noise_free=True, drift_px=0.02)
    )


@pytest.fixture(scope="session")
def done(experiment):
    """A draft of it, which every story may read."""
    return reconstruct(experiment, "draft")
