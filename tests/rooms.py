"""Simulated experiments at a grid that is no finer than what a test claims."""

import re
from importlib.resources import files
from pathlib import Path

from app.experiment.rig_settings import SimulatedCameraSettings
from app.simulate.experiment import simulate
from app.volume.scene import RigOptions

# The packaged room: a warm jet.
ROOM = Path(str(files("app.simulate.sample") / "room.npz"))


def state_grid(folder: Path, cells: int) -> Path:
    """State the cells an edge that a reconstruction of this experiment works on."""
    settings = folder / "experiment.toml"
    text, count = re.subn(r"^grid = .*$", f"grid = {cells}", settings.read_text(), flags=re.MULTILINE)
    assert count == 1
    settings.write_text(text)
    return folder


def small_experiment(folder: Path, cells: int) -> Path:
    """The packaged room before a camera of 160 px, captured, with all its openings and walls stated."""
    options = RigOptions(camera_px=(160, 120), frames=2)
    return state_grid(simulate(ROOM, folder, options, "surveyed", SimulatedCameraSettings()), cells)
