"""An experiment of two cameras for the page's tests: the packaged room's back wall and its right one.

Where projectors light them, the rig names how both are reached: twins.
"""

import shutil
from typing import Literal

from app.experiment.folder import TRUTH_FILE, ExperimentSettings, create_experiment, new_folder
from app.experiment.rig_settings import ProjectorSettings, RigSettings, SimulatedCameraSettings
from app.files.durable import write_text
from app.simulate.stated_bundle import bundle_as_stated
from app.volume.file import read_volume
from app.volume.sample import SAMPLE_ROOM
from app.volume.scene import RigOptions, room_scene
from calibration.bundle import to_json
from tests.browser.conftest import Station

VIEWS = ("camera", "camera at x_max")
TWIN = "simulated:pjlink?warm_up_s=0&cool_down_s=0"


def two_views(
    station: Station, camera_px: int = 192, light: Literal["texture", "projector"] = "texture"
) -> str:
    """Make it, calibrated, among the station's experiments; return its id."""
    options = RigOptions(camera_px=(camera_px, camera_px * 3 // 4), walls=("y_max", "x_max"), light=light)
    scene = room_scene(read_volume(SAMPLE_ROOM), options, "surveyed")
    twin = ProjectorSettings(url=TWIN)
    named = {"projector": twin, "projectors": {VIEWS[1]: twin}} if light == "projector" else {}
    rig = RigSettings(camera=SimulatedCameraSettings(), **named)
    settings = ExperimentSettings(title="Two cameras", information="surveyed", rig=rig, scene=scene)

    def fill(folder) -> None:
        made = create_experiment(folder, settings)
        shutil.copyfile(SAMPLE_ROOM, folder / TRUTH_FILE)
        write_text(made.bundle_path, to_json(bundle_as_stated(scene)))

    return new_folder(station.app.state.services.folders.root, "simulated", fill).name
