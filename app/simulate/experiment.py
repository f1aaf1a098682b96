"""`simulate`: a complete experiment from a room volume, taken by the same capture code as a real one."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

from app.capture.burst import take
from app.capture.series import PLACES
from app.capture.watched import BurstWatch
from app.errors import AirlensError, BadInputError
from app.experiment.folder import (
    TRUTH_FILE,
    Experiment,
    ExperimentSettings,
    create_experiment,
    open_experiment,
)
from app.experiment.rig_settings import RigSettings, SimulatedCameraSettings
from app.files.durable import durable_folder, write_durably, write_text
from app.rig.open import air_of, named_camera, open_camera
from app.simulate.stated_bundle import bundle_as_stated
from app.volume.file import RoomVolume, read_volume
from app.volume.misread import misread
from app.volume.scene import Information, RigOptions, room_box, room_scene, write_plane
from app.volume.snapshots import read_snapshots
from calibration.bundle import to_json
from core.scene import PlaneField, Scene
from drivers.burst import CapturePlan, Progress

SNAPSHOTS_FILE = "snapshots.npz"
# Between the bursts of a series.
_APART_S = 60.0

OnStage = Callable[[str, int, int], object]


def simulate(
    truth_path: Path,
    folder: Path,
    options: RigOptions,
    information: Information,
    camera: SimulatedCameraSettings,
    on_stage: OnStage = lambda stage, done, total: None,
    *,
    misreads: bool = False,
    bracketed: bool = False,
    cells: int | Literal["auto"] = "auto",
    snapshots_path: Path | None = None,
) -> Path:
    """Make an experiment folder from a volume: scene, calibration, reference and flow captures.

    With `misreads` what is known of the boundary is as wrong as its deviations say, by the camera's seed. With
    `bracketed` a second reference follows the flow, as a series.
    `cells` is the solver's grid, as the scene states it. With snapshots each frame of a flow capture sees the air
    of its moment.
    The whole folder appears at once, when it is complete. The truth is copied into it for the simulated
    rig and `score`; no reconstruction reads it. Raises BadInputError, SettingError.
    """
    if folder.exists() and any(folder.iterdir()):
        raise BadInputError(f"{folder} is not empty; give a new folder for the experiment.")
    volume = read_volume(truth_path)
    scene = room_scene(volume, options, information)
    scene = misread(scene, camera.seed) if misreads else scene
    scene = replace(scene, solve=replace(scene.solve, grid=cells))
    files = {TRUTH_FILE: truth_path}
    if snapshots_path is not None:
        read_snapshots(snapshots_path, room_box(volume))
        files[SNAPSHOTS_FILE] = snapshots_path
        camera = camera.model_copy(update={"snapshots": SNAPSHOTS_FILE})
    with durable_folder(folder) as unfinished:
        _fill(unfinished, files, volume, scene, information, camera)
        _capture(open_experiment(unfinished), bracketed, on_stage)
    return folder


def _fill(
    folder: Path,
    files: Mapping[str, Path],
    volume: RoomVolume,
    scene: Scene,
    information: Information,
    camera: SimulatedCameraSettings,
) -> None:
    settings = ExperimentSettings(
        title=str(volume.case.get("title", files[TRUTH_FILE].stem)),
        information=information,
        rig=RigSettings(camera=camera),
        scene=scene,
    )
    experiment = create_experiment(folder, settings)
    for name, path in files.items():
        write_durably(folder / name, lambda temporary, path=path: shutil.copyfile(path, temporary))
    if any(isinstance(known, PlaneField) for known in scene.boundary):
        write_plane(folder, volume)
    write_text(experiment.bundle_path, to_json(bundle_as_stated(scene)))


def _capture(experiment: Experiment, bracketed: bool, on_stage: OnStage) -> None:
    """Reference and flow; between two references, a minute apart, where it is bracketed."""
    settings = named_camera(experiment)
    noise_free = isinstance(settings, SimulatedCameraSettings) and settings.noise_free
    frames = 1 if noise_free else experiment.settings.scene.views[0].frames
    for place, role in enumerate(PLACES if bracketed else PLACES[:2]):
        plan = CapturePlan(role=role, frames=frames)
        series = {"id": "simulated", "place": place, "began_s": _APART_S * place} if bracketed else None

        def progress(p: Progress, role: str = role) -> None:
            on_stage(role, p.done, p.total)

        on_stage(role, 0, plan.frames)
        with open_camera(experiment, air_of(role), moment=place) as opened:
            taken = take(opened, experiment, plan, watch=BurstWatch(progress), series=series, moment=place)
        if taken.shortfall:
            raise AirlensError(taken.shortfall)
