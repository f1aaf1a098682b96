"""A simulated rig to practise with: an experiment before the packaged room, not yet calibrated or captured."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.calibrate.folder import CalibrationFolder
from app.experiment.folder import (
    TRUTH_FILE,
    Experiment,
    ExperimentSettings,
    create_experiment,
    new_folder,
    open_experiment,
)
from app.experiment.rig_settings import BoardSettings, ProjectorSettings, RigSettings
from app.files.durable import write_durably
from app.simulate.stated_bundle import bundle_as_stated
from app.simulate.worlds import WORLDS, WorldName
from app.volume.file import read_volume
from app.volume.misread import misread
from app.volume.sample import SAMPLE_ROOM
from app.volume.scene import RIG_PLACES, Information, RigOptions, room_scene, write_plane
from core.scene import PlaneField

# Fast enough to practise with; a real lamp takes longer, and its lamp guard is the real one.
TWIN = ProjectorSettings(url="simulated:?warm_up_s=8&cool_down_s=6")

# Large, for it is shown some twenty metres away.
_BOARD = BoardSettings(columns=9, rows=6, square_m=0.1)


@dataclass(frozen=True)
class Rehearsal:
    """What to simulate; a small camera keeps every step within seconds."""

    title: str = "Simulated room"
    camera_px: int = 384
    light: Literal["texture", "projector"] = "texture"
    information: Information = "surveyed"
    world: WorldName = "lab"


def rehearse(root: Path, wanted: Rehearsal) -> Experiment:
    """Make the experiment below `root` and return it; it appears at once, when it is complete."""
    volume = read_volume(SAMPLE_ROOM)
    world, seed = WORLDS[wanted.world], 0
    stand_off_m, baseline_m = RIG_PLACES[world.place]
    options = RigOptions(
        camera_px=(wanted.camera_px, wanted.camera_px * 3 // 4),
        light=wanted.light,
        stand_off_m=stand_off_m,
        baseline_m=baseline_m,
    )
    scene = room_scene(volume, options, wanted.information)
    scene = misread(scene, seed) if world.misreads else scene
    settings = ExperimentSettings(
        title=wanted.title,
        information=wanted.information,
        rig=RigSettings(
            camera=world.camera(seed),
            projector=TWIN if wanted.light == "projector" else None,
            board=_BOARD,
        ),
        scene=scene,
    )

    def fill(unfinished: Path) -> None:
        create_experiment(unfinished, settings)
        write_durably(unfinished / TRUTH_FILE, lambda temporary: shutil.copyfile(SAMPLE_ROOM, temporary))
        if any(isinstance(known, PlaneField) for known in scene.boundary):
            write_plane(unfinished, volume)

    return open_experiment(new_folder(root, "simulated", fill))


def calibrate_simulated(experiment: Experiment) -> None:
    """Write the bundle of a simulated rig, whose models are those of its scene."""
    bundle = bundle_as_stated(experiment.settings.scene)
    CalibrationFolder(experiment.folder).change_bundle(lambda _old: bundle)
