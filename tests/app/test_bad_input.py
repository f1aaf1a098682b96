"""What no iteration can save is refused by the pipeline before the first one, with the reason."""

from pathlib import Path

import numpy as np
import pytest

from app.capture.burst import take
from app.errors import BadInputError
from app.experiment.folder import ExperimentSettings, create_experiment
from app.pipeline import reconstruct
from core.geometry import Box, looking_along_y
from core.scene import CameraNoise, FixedTexture, Inlet, Outlet, Patch, Scene, View
from core.setting import SettingError
from core.watch import Watch
from drivers.burst import CapturePlan
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern

ROOM = Box(lower_m=(-1.0, -1.0, -1.0), upper_m=(1.0, 1.0, 1.0))
SUPPLY = Patch(wall="x_min", lower_m=(-0.5, 0.0), upper_m=(0.5, 0.5))
INLET = Inlet(patch=SUPPLY, temperature_k=300.0, velocity_m_s=(0.5, 0.0, 0.0))


def captured(
    folder: Path, *, x_m: float = 0.0, level: float = 1.0, roles=("reference", "flow"), known=(INLET,)
):
    """An experiment whose camera at `x_m` looks along y; the wall is two metres wide."""
    camera = looking_along_y(position_m=(x_m, -3.0, 0.0), width_px=128, height_px=96, focal_px=200.0)
    scene = Scene(room=ROOM, views=(View(camera=camera),), light=FixedTexture(), boundary=known)
    experiment = create_experiment(folder / "experiment", ExperimentSettings(scene=scene))
    picture = np.clip(level * pattern(), 0.0, 4.0)
    for role in roles:
        take(SimulatedCamera(lambda: picture, seed=1), experiment, CapturePlan(role=role, frames=2))
    return experiment.folder


def test_a_saturated_capture(tmp_path):
    with pytest.raises(BadInputError, match=r"% of the reference image is saturated"):
        reconstruct(captured(tmp_path, level=3.5), "draft")


def test_no_reference_image_is_told_before_a_time_is_promised(tmp_path):
    rows = []
    with pytest.raises(BadInputError, match="no finished reference capture"):
        reconstruct(
            captured(tmp_path, roles=("flow",)), "draft", watch=Watch(lambda row, _: rows.append(row))
        )
    assert not any(row.get("promised") for row in rows)


def test_a_wall_outside_the_view_which_sees_nothing_of_the_room(tmp_path):
    with pytest.raises(SettingError, match="sees no window of the patterned wall"):
        reconstruct(captured(tmp_path, x_m=40.0), "draft")


def test_boundary_information_that_contradicts_itself(tmp_path):
    twice = (INLET, Outlet(patch=SUPPLY))
    with pytest.raises(SettingError, match="contradict each other"):
        reconstruct(captured(tmp_path, known=twice), "draft")


@pytest.mark.parametrize("wrong", [{"full_well_e": 0.0}, {"read_noise_e": -1.0}, {"bits": 0}], ids=str)
def test_a_camera_without_noise(wrong):
    with pytest.raises(SettingError, match="expected full_well_e > 0"):
        CameraNoise(**wrong)


def test_the_file_of_an_experiment_in_place_of_its_folder(tmp_path):
    folder = captured(tmp_path, roles=())
    with pytest.raises(BadInputError, match=r"experiment\.toml is a file\. Give the folder that it is in"):
        reconstruct(folder / "experiment.toml", "draft")
