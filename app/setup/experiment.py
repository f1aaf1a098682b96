"""An experiment's folder from answers: it appears whole or not at all, and its answers can be changed."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.errors import BadInputError
from app.experiment.folder import (
    TRUTH_FILE,
    Experiment,
    create_experiment,
    new_folder,
    open_experiment,
    save_settings,
)
from app.files.durable import durable_folder, write_durably, write_text
from app.files.reading import reading
from app.files.toml import parse, to_toml, toml_data
from app.files.toml_errors import in_file
from app.files.toml_places import places_of
from app.setup.answers import Answers
from app.setup.change import changed_settings
from app.setup.mistakes import mistakes_in
from app.setup.readback import ReadBack, asked_view, listed_tables, read_back, scene_back
from app.setup.scene import SENSORS_FILE, described, sensor_table, settings_of
from app.volume.file import read_volume
from app.volume.sample import SAMPLE_ROOM
from app.volume.scene import room_box
from core.geometry import Vector3
from core.setting import SettingError

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


def answers_of(experiment: Experiment) -> ReadBack:
    """The rig and the room as answers: as they were entered, else read from the scene, whoever wrote it.

    Raises BadInputError where no camera looks at y_max, or a file is broken.
    """
    found = read_back(experiment)
    path = experiment.folder / ANSWERS_FILE
    if path.is_file():
        with reading(path, "Correct the file."):
            data = toml_data(path.read_text(encoding="utf-8"), ANSWERS_FILE)
        if not mistakes_in(data) and _still_say(experiment, parse(data, Answers, ANSWERS_FILE)):
            return replace(found, answers=data)
    return found


def _still_say(experiment: Experiment, entered: Answers) -> bool:
    """Whether nothing that answers say was changed by hand in experiment.toml since they were entered."""
    settings, corner_m = experiment.settings, experiment.settings.scene.room.lower_m
    file = experiment.folder / SENSORS_FILE
    kept = file.read_text(encoding="utf-8") if file.is_file() else ""
    described_again = scene_back(described(entered, corner_m)).answers
    return described_again == scene_back(settings).answers and kept == sensor_table(entered, corner_m)


def change_answers(experiment: Experiment, data: dict[str, Any]) -> Experiment:
    """Give an experiment other answers; who calls holds its lock. Raises BadInputError.

    Only what is answered otherwise changes. What no answer says, what hangs on the wall while camera, projector and
    pattern are answered as before, the board, the notes, and what was taken and computed stay.
    """
    text, corner_m = to_toml(data), experiment.settings.scene.room.lower_m
    before = parse(answers_of(experiment).answers, Answers, ANSWERS_FILE)
    after = read_answers(text, ANSWERS_FILE)
    if before.camera.truth != after.camera.truth:
        raise BadInputError(
            "camera.truth: the room that a simulated camera looks at cannot be changed. Make a new experiment."
        )
    view = asked_view(experiment.settings.scene)
    if (after.view or after.light) and view is not experiment.settings.scene.views[0]:
        raise BadInputError(
            f"{'view' if after.view else 'light'}: {view.name!r}, which looks at y_max, is not the first camera of "
            "experiment.toml. Put it first, or change further cameras and projectors there."
        )
    listed = listed_tables(experiment)
    try:
        settings = changed_settings(
            experiment.settings,
            (before, after),
            (described(before, corner_m), described(after, corner_m)),
            view,
            listed,
        )
    except SettingError as error:
        raise BadInputError(str(error)) from error
    if (before.thermometer, before.anemometer) != (after.thermometer, after.anemometer):
        _write_sensors(experiment.folder, after, corner_m)
    write_text(experiment.folder / ANSWERS_FILE, text)
    return save_settings(experiment.folder, settings)


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
