"""One small experiment on the packaged room, made once for every story."""

import pytest

from app.experiment.rig_settings import SimulatedCameraSettings
from app.pipeline import reconstruct
from app.simulate.experiment import simulate
from app.volume.scene import RigOptions
from tests.rooms import ROOM, state_grid


@pytest.fixture(scope="session")
def experiment(tmp_path_factory):
    folder = tmp_path_factory.mktemp("story") / "room"
    options = RigOptions(camera_px=(512, 384), frames=1)
    camera = SimulatedCameraSettings(noise_free=True, drift_px=0.02)
    return state_grid(simulate(ROOM, folder, options, "surveyed", camera), 24)


@pytest.fixture(scope="session")
def done(experiment):
    """A draft of it, which every story may read."""
    return reconstruct(experiment, "draft")
