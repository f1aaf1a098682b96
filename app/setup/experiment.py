"""An experiment's folder from answers: it appears whole or not at all, and its answers can be changed."""

import shutil
from dataclasses import replace
from pathlib import Path

from app.errors import BadInputError
from app.experiment.folder import (
    SETTINGS_FILE,
    TRUTH_FILE,
    Experiment,
    ExperimentSettings,
    create_experiment,
    new_folder,
    open_experiment,
    save_settings,
)
from app.files.durable import durable_folder, write_durably, write_text
from app.files.reading import reading
from app.files.toml import parse, toml_data
from app.files.toml_errors import in_file
from app.files.toml_places import places_of
from app.setup.answers import Answers
from app.setup.mistakes import mistakes_in
from app.setup.scene import SENSORS_FILE, sensor_table, settings_of
from app.volume.file import read_volume
from app.volume.sample import SAMPLE_ROOM
from app.volume.scene import room_box
from core.geometry import Vector3

ANSWERS_FILE = "answers.toml"
# What `truth` names the packaged room by.
SAMPLE = "sample"
TEMPLATES = ("wall-jet", "displacement", "radiator", "chilled-ceiling", "empty", "sample")


def template(name: str) -> str:
    """The text of a room's filled-in answers. Raises BadInputError for an unknown name."""
    if name not in TEMPLATES:
        raise BadInputError(f"There is no template {name!r}; there are {', '.join(TEMPLATES)}.")
    return (Path(__file__).parent / "templates" / f"{name}.toml").read_text(encoding="utf-8")


def read_answers(text: str, source: str) -> Answers:
    """The answers in a TOML text. Raises BadInputError that tells every mistake with its line and column."""
    data = toml_data(text, source)
    wrong = mistakes_in(data)
    if wrong:
        raise BadInputError(in_file(wrong, data, source, places_of(text)))
    return parse(data, Answers, source, text)


def new_experiment(folder: Path, text: str, source: str) -> Experiment:
    """Make the experiment that the answers (TOML) describe; they are kept in it. Raises BadInputError."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInputError(f"{folder} is not empty; give a new folder for the experiment.")
    answers = read_answers(text, source)
    with durable_folder(folder) as unfinished:
        _fill(unfinished, answers, text, truth_file(answers))
    return open_experiment(folder)


def add_experiment(parent: Path, text: str, truth: Path | None) -> Experiment:
    """The same in a folder with a fresh name in `parent`; a simulated camera looks at the room in `truth`.

    Raises BadInputError.
    """
    answers = read_answers(text, ANSWERS_FILE)
    return open_experiment(new_folder(parent, "room", lambda folder: _fill(folder, answers, text, truth)))


def answers_text(experiment: Experiment) -> str:
    """The answers that an experiment was made from. Raises BadInputError where it was made without."""
    path = experiment.folder / ANSWERS_FILE
    if not path.is_file():
        raise BadInputError(
            f"The rig and the room of {experiment.folder.name} were not entered as answers, so they cannot be edited "
            f"here: change them in {(experiment.folder / SETTINGS_FILE).resolve()}."
        )
    with reading(path, "Correct the file."):
        return path.read_text(encoding="utf-8")


def change_answers(experiment: Experiment, text: str) -> Experiment:
    """Give an experiment other answers; who calls holds its lock. Raises BadInputError.

    What hangs on the wall stays as it is while camera, projector and pattern are answered as before: a print is
    not made anew because a radiator was moved. The board, the notes and what was taken and computed stay too.
    """
    before, after = read_answers(answers_text(experiment), ANSWERS_FILE), read_answers(text, ANSWERS_FILE)
    if before.camera.truth != after.camera.truth:
        raise BadInputError(
            "camera.truth: the room that a simulated camera looks at cannot be changed. Make a new experiment."
        )
    # The room's own copy: a path in a folder from elsewhere is not followed.
    corner_m = corner_of(experiment.folder / TRUTH_FILE if after.camera.truth else None)
    settings = _merged(experiment.settings, settings_of(after, corner_m), before, after)
    _write_sensors(experiment.folder, after, corner_m)
    write_text(experiment.folder / ANSWERS_FILE, text)
    return save_settings(experiment.folder, settings)


def _merged(
    old: ExperimentSettings, new: ExperimentSettings, before: Answers, after: Answers
) -> ExperimentSettings:
    same = (before.camera, before.projector, before.pattern_seed) == (
        after.camera,
        after.projector,
        after.pattern_seed,
    )
    scene = replace(new.scene, light=old.scene.light) if same else new.scene
    rig = old.rig if same else new.rig.model_copy(update={"board": old.rig.board})
    return new.model_copy(update={"information": old.information, "rig": rig, "scene": scene})


def _fill(folder: Path, answers: Answers, text: str, truth: Path | None) -> None:
    corner_m = corner_of(truth)
    create_experiment(folder, settings_of(answers, corner_m))
    write_text(folder / ANSWERS_FILE, text)
    _write_sensors(folder, answers, corner_m)
    if truth is not None:
        write_durably(folder / TRUTH_FILE, lambda temporary: shutil.copyfile(truth, temporary))


def truth_file(answers: Answers) -> Path | None:
    """The room that a simulated camera looks at."""
    return room_of(answers.camera.truth) if answers.camera.truth else None


def room_of(named: str) -> Path:
    """The file of a room that `truth` names."""
    return SAMPLE_ROOM if named == SAMPLE else Path(named)


def corner_of(truth: Path | None) -> Vector3:
    """A simulated room keeps its own coordinates: its corner is where they have it. Raises BadInputError."""
    return (0.0, 0.0, 0.0) if truth is None else room_box(read_volume(truth)).lower_m


def _write_sensors(folder: Path, answers: Answers, corner_m: Vector3) -> None:
    sensors = sensor_table(answers, corner_m)
    if sensors:
        write_text(folder / SENSORS_FILE, sensors)
    else:
        (folder / SENSORS_FILE).unlink(missing_ok=True)
