"""An experiment's folder from answers: it appears whole or not at all."""

import re
import shutil
from pathlib import Path

from app.errors import BadInputError
from app.experiment.folder import Experiment, create_experiment, open_experiment
from app.files.durable import durable_folder, write_durably, write_text
from app.files.toml import from_toml
from app.files.toml_errors import at_place
from app.files.toml_places import nearest, places_of
from app.setup.answers import Answers
from app.setup.scene import SENSORS_FILE, TRUTH_FILE, sensor_table, settings_of
from app.volume.file import read_volume
from app.volume.scene import room_box

ANSWERS_FILE = "answers.toml"
TEMPLATES = ("wall-jet", "displacement", "radiator", "chilled-ceiling", "empty")


def template(name: str) -> str:
    """The text of a room's filled-in answers. Raises BadInputError for an unknown name."""
    if name not in TEMPLATES:
        raise BadInputError(f"There is no template {name!r}; there are {', '.join(TEMPLATES)}.")
    return (Path(__file__).parent / "templates" / f"{name}.toml").read_text(encoding="utf-8")


def new_experiment(folder: Path, text: str, source: str) -> Experiment:
    """Make the experiment that the answers (TOML) describe; they are kept in it. Raises BadInputError."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInputError(f"{folder} is not empty; give a new folder for the experiment.")
    answers = from_toml(text, Answers, source)
    truth = Path(answers.camera.truth) if answers.camera.truth else None
    # A simulated room keeps its own coordinates: its corner is where they have it.
    corner_m = (0.0, 0.0, 0.0) if truth is None else room_box(read_volume(truth)).lower_m
    try:
        settings = settings_of(answers, corner_m)
    except BadInputError as error:
        raise BadInputError(_placed(str(error), text, source)) from error
    with durable_folder(folder) as unfinished:
        create_experiment(unfinished, settings)
        write_text(unfinished / ANSWERS_FILE, text)
        sensors = sensor_table(answers, corner_m)
        if sensors:
            write_text(unfinished / SENSORS_FILE, sensors)
        if truth is not None:
            write_durably(unfinished / TRUTH_FILE, lambda temporary: shutil.copyfile(truth, temporary))
    return open_experiment(folder)


def _placed(sentence: str, text: str, source: str) -> str:
    """A sentence about an answer (`supply 2: ...`, `camera.position: ...`) with the line and column of it."""
    named = re.match(r"([a-z_.]+)(?: (\d+))?: ", sentence)
    path = [*named[1].split("."), *([int(named[2]) - 1] if named[2] else [])] if named else []
    found = nearest(places_of(text), tuple(path))
    return f"{at_place(source, found[1].key)}: {sentence}" if found else sentence
